// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/surface.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/statistics.h"
#include "helicarm/registration/surface_file.h"
#include "helicarm/registration/vtp.h"
#include "helicarm/registration/weld.h"
#include "helicarm/volume/declared.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using phantom::TriangleMesh;

constexpr std::uintmax_t most_bytes = std::uintmax_t{1} << 30;
// From the middle of the surface, and from the origin: no bone is larger, and no patient lies farther away.
constexpr double farthest_corner_mm = 1000, farthest_place_mm = 10000;

/// What a file of another kind is, with the way out; empty if it is not known.
std::string_view other_kind_of_surface(std::string_view bytes) {
  const std::string_view start = bytes.substr(0, 4000);
  const auto holds = [&](std::string_view word) { return start.find(word) != std::string_view::npos; };
  if (start.starts_with("NRRD000") || holds("ElementDataFile") || holds("DimSize") ||
      (start.size() >= 348 && (start.substr(344, 3) == "n+1" || start.substr(344, 3) == "ni1")) ||
      start.substr(std::min<std::size_t>(4, start.size())).starts_with("n+2"))
    return "a volume: give it as \"volume\" or \"mask\" of the model";
  if (start.size() > 132 && start.substr(128, 4) == "DICM")
    return "a DICOM file: export the segmentation as a closed surface (STL, PLY, VTP)";
  if (start.starts_with("OFF")) return "an OFF file: save the model as STL, PLY or VTP";
  if (start.starts_with("PK\3\4")) return "a ZIP archive or 3MF: save the model as STL, PLY or VTP";
  if (start.starts_with("\x1f\x8b")) return "compressed: decompress it";
  if (start.starts_with("glTF")) return "a glTF file: save the model as STL, PLY or VTP";
  if (start.starts_with("ISO-10303")) return "a STEP file: save the model as STL, PLY or VTP";
  if (start.starts_with("\xff\xff\xfe")) return "a surface of FreeSurfer: save the model as STL, PLY or VTP";
  if (start.starts_with("<")) return "XML other than VTP (VTK's PolyData): save the model as STL, PLY or VTP";
  return {};
}

SurfaceFile file_from(std::string_view bytes, const std::string& origin) {
  if (is_sized_stl(bytes)) return binary_stl(bytes, origin);
  if (is_text_stl(bytes)) return text_stl(bytes, origin);
  const bool marked = bytes.starts_with("\xEF\xBB\xBF");
  const std::string_view text = bytes.substr(marked ? 3 : 0);
  if (is_ply(text)) return ply_surface(text, origin);
  if (is_vtk_xml(text)) return vtp_surface(text, origin);
  if (is_legacy_vtk(text)) return legacy_vtk_surface(text, origin);
  if (is_obj(text)) return obj_surface(text, origin);
  if (const std::string_view kind = other_kind_of_surface(text); !kind.empty())
    throw BadInput(Reason::unsupported, fmt::format("{}: is {}", origin, kind));
  return binary_stl(bytes, origin);
}

/// To L, P, S and mm, where the file states another space or unit.
void convert(SurfaceFile& file, const std::string& origin) {
  const volume::Declared declared = volume::declared_in(file.declares, origin);
  Vector3d factors(1, 1, 1);
  if (!declared.space.empty())
    factors = volume::declared_space(declared.space, origin + ": the stated space");
  if (!declared.unit.empty()) factors *= volume::declared_unit(declared.unit, origin + ": the stated unit");
  if (factors == Vector3d(1, 1, 1)) return;
  for (Vector3d& corner : file.mesh.corners) corner = corner.cwiseProduct(factors);
}

/// Median of each coordinate; one corner that is far off does not move it.
Vector3d middle_corner(const TriangleMesh& mesh) {
  constexpr std::size_t most_sampled = 20000;
  const std::size_t stride = mesh.triangles.size() / most_sampled + 1;
  Vector3d middle;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (std::size_t i = 0; i < mesh.triangles.size(); i += stride)
      for (const std::uint32_t corner : mesh.triangles[i]) values.push_back(mesh.corners[corner][axis]);
    middle[axis] = median(std::move(values));
  }
  return middle;
}

/// Before anything is built from it: one corner far away would make every grid over the surface huge.
void check_corners(const TriangleMesh& mesh, const std::string& origin) {
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t corner : triangle)
      if (!mesh.corners[corner].allFinite())
        throw BadInput(Reason::not_finite, fmt::format("{}: corner {} is not finite", origin, corner));
  if (mesh.triangles.empty()) return;
  const Vector3d middle = middle_corner(mesh);
  for (const auto& triangle : mesh.triangles)
    for (const std::uint32_t corner : triangle) {
      const Vector3d& at = mesh.corners[corner];
      const double apart = (at - middle).norm(), away = at.norm();
      if (apart <= farthest_corner_mm && away <= farthest_place_mm) continue;
      const bool off = apart > farthest_corner_mm;
      throw BadInput(Failure{
          Reason::bad_value,
          fmt::format(
              "{}: corner {} at ({:.6g}, {:.6g}, {:.6g}) mm is {:.6g} mm from the {}, limit {:g} mm: the "
              "file is damaged or not in mm",
              origin, corner, at.x(), at.y(), at.z(), off ? apart : away,
              off ? "middle of the surface" : "origin", off ? farthest_corner_mm : farthest_place_mm),
          {},
          {{"distance_mm", off ? apart : away}, {"limit_mm", off ? farthest_corner_mm : farthest_place_mm}}});
    }
}

}  // namespace

Expected<SurfaceMesh> surface_of_file(SurfaceFile file, const std::string& origin) {
  return guarded([&] {
    convert(file, origin);
    check_corners(file.mesh, origin);
    SurfaceMesh surface{welded(file.mesh), std::move(file.warnings)};
    if (surface.triangles.size() < 4)
      throw BadInput(Reason::bad_value, fmt::format("{}: {} triangles, a closed surface has at least 4",
                                                    origin, surface.triangles.size()));
    return surface;
  });
}

Expected<SurfaceMesh> surface_from(std::string_view bytes, const std::string& origin) {
  return guarded([&] { return value_or_throw(surface_of_file(file_from(bytes, origin), origin)); });
}

Expected<SurfaceMesh> read_surface(const std::filesystem::path& path) {
  return read_file(path, most_bytes).and_then([&](const std::string& bytes) {
    return surface_from(bytes, path.filename().string());
  });
}

Expected<Surface> prepare_surface(TriangleMesh mesh, const std::string& origin) {
  if (phantom::volume(mesh) < 0)
    for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
  Surface surface{std::move(mesh), {}, {}};
  for (std::uint32_t face = 0; face < surface.mesh.triangles.size(); ++face) {
    const auto& t = surface.mesh.triangles[face];
    const auto& c = surface.mesh.corners;
    surface.normals.push_back((c[t[1]] - c[t[0]]).cross(c[t[2]] - c[t[0]]).normalized());
  }
  const std::vector<FaceSide> sides = face_sides(surface.mesh);
  std::size_t open = 0;
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t end = i + 1;
    while (end < sides.size() && sides[end][0] == sides[i][0] && sides[end][1] == sides[i][1]) ++end;
    if (end - i == 2)
      surface.edges.push_back({{sides[i][0], sides[i][1]}, {sides[i][2], sides[i + 1][2]}});
    else if (end - i == 1)
      ++open;
    i = end;
  }
  const double share = double(open) / double(sides.size());
  if (share > 0.01)
    return fail(Reason::bad_value,
                fmt::format("{}: the surface is not closed: {:.1f} % of its edges bound one triangle only, "
                            "limit 1 %; close its holes",
                            origin, 100 * share),
                {{"open_edges", double(open)}});
  return surface;
}

}  // namespace helicarm::registration
