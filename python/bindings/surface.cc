// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/surface.h"

#include <memory>

#include "arrays.h"
#include "helicarm/registration/surface_file.h"
#include "helicarm/volume/declared.h"
#include "module.h"

namespace helicarm::python {
namespace {

using registration::SurfaceMesh;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

std::shared_ptr<SurfaceMesh> surface_from(const Doubles& vertices, const py::object& triangles,
                                          const std::string& frame, const std::string& unit) {
  registration::SurfaceFile file;
  file.mesh.corners = rows_of<3>(vertices, "vertices");
  const py::array faces = plain_array(triangles, "faces");
  if (faces.ndim() != 2 || faces.shape(1) != 3)
    raise({Reason::bad_value,
           fmt::format("faces: shape {} is not (N, 3): the vertices of each triangle", shape_of(faces)),
           {},
           {}});
  if (std::string_view("iu").find(faces.dtype().kind()) == std::string_view::npos)
    raise({Reason::bad_value,
           fmt::format("faces: its elements are {}, not whole numbers: faces.astype(int) makes them so",
                       std::string(py::str(py::object(faces.dtype())))),
           {},
           {}});
  value_or_raise(guarded([&] { registration::check_triangles(double(faces.shape(0)), "faces"); }));
  const Indices indices = Indices::ensure(faces);
  const auto count = std::int64_t(file.mesh.corners.size());
  for (py::ssize_t face = 0; face < indices.shape(0); ++face) {
    auto& triangle = file.mesh.triangles.emplace_back();
    for (py::ssize_t side = 0; side < 3; ++side) {
      const std::int64_t corner = indices.at(face, side);
      if (corner < 0 || corner >= count)
        raise({Reason::bad_value,
               fmt::format("faces: row {} holds {}, the vertices are 0 to {}", face, corner, count - 1),
               {},
               {}});
      triangle[std::size_t(side)] = std::uint32_t(corner);
    }
  }
  // As stated by a file's header.
  value_or_raise(guarded([&] {
    const Eigen::Vector3d factors =
        volume::declared_space(frame, "frame") * volume::declared_unit(unit, "unit");
    for (Eigen::Vector3d& corner : file.mesh.corners) corner = corner.cwiseProduct(factors);
  }));
  return std::make_shared<SurfaceMesh>(
      value_or_raise(without_gil([&] { return registration::surface_of_file(std::move(file), "Surface"); })));
}

py::array faces_of(const SurfaceMesh& surface) {
  py::array_t<std::uint32_t> array({py::ssize_t(surface.triangles.size()), py::ssize_t{3}});
  std::uint32_t* at = array.mutable_data();
  for (const auto& triangle : surface.triangles) at = std::ranges::copy(triangle, at).out;
  return read_only(array);
}

}  // namespace

void add_surface(py::module_& module) {
  py::class_<SurfaceMesh, std::shared_ptr<SurfaceMesh>>(module, "Surface",
                                                        R"(A surface of triangles in memory.

Surface(vertices, faces, *, frame, unit="mm")
  vertices: (V, 3); faces: (F, 3) whole numbers, the vertices of each triangle; vertices at one place are
  joined and numbered anew, in the order of the faces
  frame: of the vertices: "LPS" (DICOM, ITK), "RAS" (3D Slicer) or another patient space; LPS inside
  unit: of length: mm, cm, m, inch, ...
Raises InputError: bad_size, bad_value (a vertex over 1 m from the middle), not_finite, unsupported (another frame or
unit). as_surface takes objects of other packages, read_surface files.)")
      .def(py::init(&surface_from), py::arg("vertices"), py::arg("faces"), py::kw_only(), py::arg("frame"),
           py::arg("unit") = "mm")
      .def_property_readonly(
          "vertices", [](const SurfaceMesh& s) { return read_only(rows_array<3>(s.corners)); },
          "(V, 3) L, P, S, mm.")
      .def_property_readonly("faces", &faces_of, "(F, 3) uint32.")
      .def_property_readonly("warnings", [](const SurfaceMesh& s) { return warning_list(s.warnings); })
      .def(py::pickle(
          [](const SurfaceMesh& s) {
            return py::make_tuple(rows_array<3>(s.corners), faces_of(s), warning_list(s.warnings));
          },
          [](const py::tuple& state) {
            auto loaded = surface_from(state[0].cast<Doubles>(), state[1].cast<py::array>(), "LPS", "mm");
            loaded->warnings = warnings_from(state[2].cast<py::list>());
            return loaded;
          }))
      .def("__repr__", [](const SurfaceMesh& s) {
        return fmt::format("<Surface: {} vertices, {} triangles>", s.corners.size(), s.triangles.size());
      });
  module.def("_unit_mm", [](const std::string& unit) {
    return value_or_raise(guarded([&] { return volume::declared_unit(unit, "unit"); }));
  });
  module.def("_space_signs", [](const std::string& frame) {
    return rows_array<3>({value_or_raise(guarded([&] { return volume::declared_space(frame, "frame"); }))},
                         true)
        .attr("tolist")();
  });
  module.def(
      "read_surface",
      [](const std::filesystem::path& path) {
        return std::make_shared<SurfaceMesh>(
            value_or_raise(without_gil([&] { return registration::read_surface(path); })));
      },
      py::arg("path"),
      R"(Reads STL, PLY, OBJ, VTP or legacy VTK; a frame and unit that the file states are converted. Returns a Surface.

Raises InputError: missing_file, truncated, bad_size, bad_value, not_finite, unsupported.)");
}

}  // namespace helicarm::python
