// SPDX-License-Identifier: Apache-2.0
#include "arrays.h"
#include "checks.h"
#include "helicarm/devices/tracker/sequence_file.h"
#include "helicarm/exchange/import_matrix.h"
#include "helicarm/exchange/itk_transform.h"
#include "helicarm/exchange/matrix_transform.h"
#include "helicarm/geometry/decomposition.h"
#include "helicarm/volume/declared.h"
#include "helicarm/volume/drr_view.h"
#include "module.h"

namespace helicarm::python {
namespace {

using Camera = exchange::ImportedMatrix;
using ImageShape = std::optional<std::pair<int, int>>;

std::optional<Eigen::Vector2i> size_of(const ImageShape& shape) {
  if (!shape) return {};
  return Eigen::Vector2i(shape->second, shape->first);
}

Camera camera_from(const Doubles& k, const Doubles& r, const Doubles& t, const ImageShape& shape) {
  constexpr double rounded = 1e-6;
  const Eigen::Matrix3d inner = matrix_of(k, 3, 3, "K"), turn = matrix_of(r, 3, 3, "R");
  Camera camera;
  camera.view.camera_from_world = {turn, row_of<3>(t, "t")};
  camera.image_size = size_of(shape);
  if (!(turn * turn.transpose()).isIdentity(rounded) || turn.determinant() < 0)
    raise({Reason::bad_value,
           "R: is not a proper rotation; a mirrored image has a negative K[0, 0] instead",
           {},
           {{"determinant", turn.determinant()}}});
  if (inner(1, 0) != 0 || inner(2, 0) != 0 || inner(2, 1) != 0 || inner(2, 2) != 1 || inner(0, 0) == 0 ||
      inner(1, 1) == 0)
    raise({Reason::bad_value, "K: is not upper triangular with a last row 0 0 1", {}, {}});
  camera.view.intrinsics = {inner(0, 0), inner(1, 1), inner(0, 2), inner(1, 2), inner(0, 1)};
  if (const auto flipped = exchange::mirrored_or_upwards(camera.view.intrinsics))
    camera.warnings.push_back(*flipped);
  return camera;
}

Camera camera_of_projection(const Doubles& projection, const std::optional<Doubles>& point_in_front,
                            const ImageShape& shape) {
  const geometry::Projection matrix = matrix_of(projection, 3, 4, "projection");
  Camera camera;
  camera.view = value_or_raise(
      point_in_front ? geometry::decompose(matrix, row_of<3>(*point_in_front, "point_in_front_mm"))
                     : geometry::decompose(matrix));
  camera.image_size = size_of(shape);
  return camera;
}

Camera camera_on_orbit(const Doubles& centre_mm, double angle_deg, double tilt_deg, int size, double pixel_mm,
                       double source_detector_mm, double source_centre_mm) {
  checked(angle_deg, {-360, 360}, "angle_deg");
  checked(tilt_deg, {-89, 89}, "tilt_deg");
  checked(size, {1, 8192}, "size");
  checked(pixel_mm, {0.01, 20}, "pixel_mm");
  checked(source_detector_mm, {10, 1e5}, "source_detector_mm");
  checked(source_centre_mm, {1, 1e5}, "source_centre_mm");
  return {volume::drr_view({size, pixel_mm, source_detector_mm, source_centre_mm, angle_deg, tilt_deg},
                           row_of<3>(centre_mm, "centre_mm")),
          Eigen::Vector2i(size, size)};
}

std::optional<double> mm_of(const std::optional<std::string>& unit) {
  if (!unit) return {};
  return value_or_raise(guarded([&] { return volume::declared_unit(*unit, "unit"); }));
}

Camera camera_of_file(const std::filesystem::path& path, const std::optional<std::string>& unit,
                      std::optional<int> column, const ImageShape& shape,
                      const std::optional<std::pair<double, double>>& pixel_mm,
                      const std::optional<std::pair<double, double>>& origin_mm, bool undistorted) {
  const auto pair = [](const auto& given) -> std::optional<Eigen::Vector2d> {
    if (!given) return {};
    return Eigen::Vector2d(given->first, given->second);
  };
  return value_or_raise(exchange::import_matrix(
      path, {mm_of(unit), column, size_of(shape), pair(pixel_mm), pair(origin_mm), undistorted}));
}

/// (N, 4, 4) of each name; nan where there is none.
py::dict sequence_of_file(const std::filesystem::path& path, double mm) {
  const tracker::TransformSequence read = value_or_raise(tracker::read_slicer_sequence(path));
  py::dict answer, transforms;
  for (const auto& [name, of] : read.transforms) {
    Doubles matrices({py::ssize_t(of.size()), py::ssize_t(4), py::ssize_t(4)});
    auto at = matrices.mutable_unchecked<3>();
    for (std::size_t f = 0; f < of.size(); ++f) {
      Eigen::Matrix4d matrix = Eigen::Matrix4d::Constant(std::numeric_limits<double>::quiet_NaN());
      if (of[f]) {
        matrix = of[f]->matrix();
        matrix.topRightCorner<3, 1>() *= mm;
      }
      for (int i = 0; i < 16; ++i) at(py::ssize_t(f), i / 4, i % 4) = matrix(i / 4, i % 4);
    }
    transforms[py::str(name)] = matrices;
  }
  answer["index"] = py::array_t<double>(py::ssize_t(read.index.size()), read.index.data());
  answer["transforms"] = transforms;
  return answer;
}

py::dict transform_of_file(const std::filesystem::path& path, const std::optional<std::string>& unit) {
  py::dict answer;
  if (path.extension() == ".mha" || path.extension() == ".mhd")
    return sequence_of_file(path, mm_of(unit).value_or(1));
  const auto add = [&](geometry::RigidTransform transform, const char* forward, const char* back) {
    transform.translation *= mm_of(unit).value_or(1);
    answer[forward] = matrix_array(transform.matrix());
    answer[back] = matrix_array(transform.inverse().matrix());
    return answer;
  };
  if (const auto itk = value_or_raise(exchange::read_itk_transform(path)))
    return add(*itk, "moving_from_fixed", "fixed_from_moving");
  if (const auto matrix = value_or_raise(exchange::read_matrix_transform(path)))
    return add(*matrix, "matrix", "inverse");
  raise(
      {Reason::unsupported,
       path.string() + ": is neither an ITK transform nor a rigid 4 x 4 matrix; import_camera reads cameras",
       {},
       {}});
}

py::object shape_of_image(const Camera& camera) {
  if (!camera.image_size) return py::none();
  return py::make_tuple(camera.image_size->y(), camera.image_size->x());
}

}  // namespace

void add_camera(py::module_& module) {
  py::class_<Camera>(module, "Camera",
                     R"(A pinhole camera: world, mm, to the pixels of an image free of distortion.

Camera(K, R, t, *, shape=None)
  K: (3, 3) pixels, upper triangular; K[0, 0] < 0 in a mirrored image. R: (3, 3), t: (3,) mm: camera = R world + t, z from
  the source towards the detector. shape: (height, width) of its images.
Raises InputError: bad_value, not_finite.)")
      .def(py::init(&camera_from), py::arg("K"), py::arg("R"), py::arg("t"), py::kw_only(),
           py::arg("shape") = py::none())
      .def_static("from_projection", &camera_of_projection, py::arg("projection"), py::kw_only(),
                  py::arg("point_in_front_mm") = py::none(), py::arg("shape") = py::none(),
                  R"(Of a 3 x 4 matrix of any scale.

point_in_front_mm: a world point in front of the source, which decides the sign; without it the image is not mirrored.
Raises InputError: bad_value, not_finite; RefusedError: point_at_infinity.)")
      .def_static("orbit", &camera_on_orbit, py::arg("centre_mm"), py::kw_only(), py::arg("angle_deg") = 0.0,
                  py::arg("tilt_deg") = 0.0, py::arg("size") = volume::DrrGeometry{}.size,
                  py::arg("pixel_mm") = volume::DrrGeometry{}.pixel_mm,
                  py::arg("source_detector_mm") = volume::DrrGeometry{}.source_detector_mm,
                  py::arg("source_centre_mm") = volume::DrrGeometry{}.source_centre_mm,
                  R"(On an orbit about a point of the patient (L, P, S), as `helicarm drr` has it.

angle_deg: 0 anterior, 90 at the patient's left; tilt_deg: of the source towards the head; size: pixels per side.)")
      .def_property_readonly(
          "K", [](const Camera& c) { return read_only(matrix_array(c.view.intrinsics.matrix())); }, "(3, 3)")
      .def_property_readonly(
          "R", [](const Camera& c) { return read_only(matrix_array(c.view.camera_from_world.rotation)); },
          "(3, 3)")
      .def_property_readonly(
          "t",
          [](const Camera& c) {
            return read_only(rows_array<3>({c.view.camera_from_world.translation}, true));
          },
          "(3,) mm")
      .def_property_readonly(
          "projection", [](const Camera& c) { return read_only(matrix_array(c.view.projection())); },
          "(3, 4); the third row's first part has unit norm, positive in front of the source.")
      .def_property_readonly(
          "source_mm",
          [](const Camera& c) { return read_only(rows_array<3>({c.view.source_in_world()}, true)); },
          "(3,) world.")
      .def_property_readonly("shape", &shape_of_image, "(height, width) of its images, or None.")
      .def_property_readonly("warnings", [](const Camera& c) { return warning_list(c.warnings); })
      .def(
          "project",
          [](const Camera& c, const Doubles& xyz_mm) {
            constexpr double nan = std::numeric_limits<double>::quiet_NaN();
            std::vector<Eigen::Vector2d> pixels;
            for (const Eigen::Vector3d& point : rows_of<3>(xyz_mm, "xyz_mm"))
              pixels.push_back(c.view.depth(point) > 0 ? c.view.project(point)
                                                       : Eigen::Vector2d::Constant(nan).eval());
            return rows_array<2>(pixels, xyz_mm.ndim() == 1);
          },
          py::arg("xyz_mm"), "(N, 3) or (3,) world, mm, to (N, 2) or (2,) pixels; NaN behind the source.")
      .def(py::pickle(
          [](const Camera& c) {
            const geometry::RigidTransform& pose = c.view.camera_from_world;
            return py::make_tuple(matrix_array(c.view.intrinsics.matrix()), matrix_array(pose.rotation),
                                  rows_array<3>({pose.translation}, true), shape_of_image(c),
                                  warning_list(c.warnings));
          },
          [](const py::tuple& state) {
            Camera camera = camera_from(state[0].cast<Doubles>(), state[1].cast<Doubles>(),
                                        state[2].cast<Doubles>(), state[3].cast<ImageShape>());
            camera.warnings = warnings_from(state[4].cast<py::list>());
            return camera;
          }))
      .def("__repr__", [](const Camera& c) {
        const Eigen::Vector3d at = c.view.source_in_world();
        return fmt::format("<Camera: source at {:.1f} {:.1f} {:.1f} mm, fy {:.1f} px>", at.x(), at.y(),
                           at.z(), c.view.intrinsics.fy);
      });
  module.def(
      "import_camera", &camera_of_file, py::arg("path"), py::kw_only(), py::arg("unit") = py::none(),
      py::arg("column") = py::none(), py::arg("shape") = py::none(), py::arg("pixel_mm") = py::none(),
      py::arg("origin_mm") = py::none(), py::arg("undistorted") = false,
      R"(A camera of another program's file, as `helicarm import` reads it: MayaCam 1 or 2, OpenCV (YAML, XML, JSON), RTK
(XML), DLT coefficients, NRRD, a 3 x 4 matrix as text or JSON.

unit: the file's unit of length. column: of a table of DLT coefficients or projection of an RTK geometry, from 1. shape:
(height, width), for DLT and RTK. pixel_mm, origin_mm: (column, row) spacing and first pixel's centre of RTK's images.
undistorted: the images are free of distortion, a lens distortion that the file states is not refused. Returns a Camera.
Raises InputError: missing_file, truncated, bad_json, bad_value, not_finite, bad_size, unsupported, usage.)");
  module.def(
      "import_transform", &transform_of_file, py::arg("path"), py::kw_only(), py::arg("unit") = py::none(),
      R"(The rigid transform of an ITK file (.tfm, .txt, .h5) or of a 4 x 4 matrix, or a sequence of them, as `helicarm import` reads it.

unit: the file's unit of length. Returns {"moving_from_fixed", "fixed_from_moving"} of an ITK file (LPS, mm), {"matrix",
"inverse"} of a matrix: (4, 4). Of a sequence of transforms of 3D Slicer (.seq.mha; RAS, to parent): {"index": (N,), "transforms":
{name: (N, 4, 4)}}, LPS, nan where there is none. Raises InputError as import_camera.)");
}

}  // namespace helicarm::python
