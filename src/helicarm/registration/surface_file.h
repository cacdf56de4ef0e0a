// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/mesh.h"
#include "helicarm/registration/surface.h"

namespace helicarm::registration {

/// A surface as its file holds it: corners are not joined.
struct SurfaceFile {
  phantom::TriangleMesh mesh;
  std::string declares;  ///< text that may state a space or a unit
  std::vector<Warning> warnings;
};

/// The surface of what a file holds, or of a mesh in memory: in L, P, S and mm, corners joined. Fails as
/// `read_surface`; more than `max_triangles` are for the caller to refuse.
Expected<SurfaceMesh> surface_of_file(SurfaceFile file, const std::string& origin);

// Readers of the formats; all throw BadInput. `bytes` is the whole file.
bool is_text_stl(std::string_view bytes);
SurfaceFile text_stl(std::string_view bytes, const std::string& origin);
SurfaceFile binary_stl(std::string_view bytes, const std::string& origin);
bool is_ply(std::string_view bytes);
SurfaceFile ply_surface(std::string_view bytes, const std::string& origin);
/// Wavefront OBJ: its polygons, in groups or not, as one surface.
bool is_obj(std::string_view bytes);
SurfaceFile obj_surface(std::string_view bytes, const std::string& origin);
/// VTK's legacy PolyData, text or binary: polygons and triangle strips.
bool is_legacy_vtk(std::string_view bytes);
SurfaceFile legacy_vtk_surface(std::string_view bytes, const std::string& origin);

/// Whether a binary STL's length is that of the triangles its header states.
bool is_sized_stl(std::string_view bytes);

/// Refuses (bad_size) more than `max_triangles`.
void check_triangles(double triangles, const std::string& origin);

/// Adds the polygon's triangles.
void add_polygon(phantom::TriangleMesh& mesh, const std::vector<std::uint32_t>& corners);

/// A line longer than this declares nothing.
inline constexpr std::size_t longest_declaration = 500;

/// Words of a text, one after the other.
class SurfaceWords {
 public:
  SurfaceWords(std::string_view text, const std::string& origin) : rest_(text), origin_(&origin) {}
  /// Empty at the end.
  std::string_view next();
  /// Throws truncated at the end, and bad_value.
  double number();
  /// Removes the rest of the line and returns it.
  std::string_view line();
  std::string_view rest() const { return rest_; }
  const std::string& origin() const { return *origin_; }

 private:
  std::string_view rest_;
  const std::string* origin_;
};

}  // namespace helicarm::registration
