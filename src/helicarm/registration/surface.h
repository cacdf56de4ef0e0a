// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/mesh.h"

namespace helicarm::registration {

/// Largest number of triangles of a surface file.
inline constexpr std::size_t max_triangles = 5'000'000;

/// A surface in L, P, S and mm with what was odd in its file.
struct SurfaceMesh : phantom::TriangleMesh {
  std::vector<Warning> warnings = {};
};

/// Reads STL (binary or text), PLY (text or binary), OBJ, VTK XML PolyData (`vtp_surface`) or VTK's legacy
/// PolyData, detected by content. A space (RAS, LAS, LPS) and a unit that header, comments or field data
/// state are converted to L, P, S and mm. Corners at one place, up to rounding, are joined. Warns of
/// surplus_data, irregular_file. Fails with missing_file, truncated, bad_size, bad_value (a corner over 1 m
/// from the surface's middle), not_finite, unsupported.
Expected<SurfaceMesh> read_surface(const std::filesystem::path& path);
Expected<SurfaceMesh> surface_from(std::string_view bytes, const std::string& origin);

/// A triangle mesh prepared for its apparent contour.
struct Surface {
  struct Edge {
    std::uint32_t corners[2];
    std::uint32_t faces[2];
  };
  phantom::TriangleMesh mesh;
  std::vector<Eigen::Vector3d> normals;  ///< outward, per triangle
  std::vector<Edge> edges;               ///< between two triangles
};

/// Normals and edges; the mesh is turned outside out if its volume is negative. Refuses (bad_value) a surface
/// that is not closed: over 1 % of its edges have no second triangle.
Expected<Surface> prepare_surface(phantom::TriangleMesh mesh, const std::string& origin);

}  // namespace helicarm::registration
