// SPDX-License-Identifier: Apache-2.0
#include "arrays.h"
#include "checks.h"
#include "helicarm/core/files.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/plate.h"
#include "module.h"

namespace helicarm::python {
namespace {

py::array centres(const phantom::Calibrator& calibrator) {
  std::vector<Eigen::Vector3d> rows;
  for (const phantom::CalibratorBall& ball : calibrator.balls) rows.push_back(ball.centre_in_calibrator);
  return rows_array<3>(rows);
}

std::vector<std::string> labels(const phantom::Calibrator& calibrator) {
  std::vector<std::string> names;
  for (const phantom::CalibratorBall& ball : calibrator.balls) names.push_back(ball.label);
  return names;
}

py::array diameters(const phantom::Calibrator& calibrator) {
  py::array_t<double> array(py::ssize_t(calibrator.balls.size()));
  for (std::size_t i = 0; i < calibrator.balls.size(); ++i)
    array.mutable_at(i) = calibrator.balls[i].diameter_mm;
  return array;
}

Json json_row(const double* numbers, py::ssize_t count) {
  Json row = Json::array();
  for (py::ssize_t i = 0; i < count; ++i) row.push_back(numbers[i]);
  return row;
}

Json json_rows(const double* numbers, py::ssize_t rows, py::ssize_t columns) {
  Json list = Json::array();
  for (py::ssize_t row = 0; row < rows; ++row) list.push_back(json_row(numbers + row * columns, columns));
  return list;
}

void set_covariance(Json& calibrator, const Doubles& mm2, const std::vector<std::string>& labels) {
  const auto n = py::ssize_t(labels.size());
  check_finite(mm2, "covariance_mm2");
  if (mm2.ndim() == 2 && mm2.shape(0) == 3 * n && mm2.shape(1) == 3 * n) {
    calibrator["joint_covariance"] = {{"balls", labels}, {"mm2", json_rows(mm2.data(), 3 * n, 3 * n)}};
    return;
  }
  if (mm2.ndim() != 3 || mm2.shape(0) != n || mm2.shape(1) != 3 || mm2.shape(2) != 3)
    raise({Reason::bad_value,
           fmt::format("covariance_mm2: shape {} is neither ({}, 3, 3) nor ({}, {})", shape_of(mm2), n, 3 * n,
                       3 * n),
           {},
           {}});
  for (py::ssize_t ball = 0; ball < n; ++ball)
    calibrator["balls"][std::size_t(ball)]["covariance_mm2"] = json_rows(mm2.data(ball, 0, 0), 3, 3);
}

phantom::Calibrator calibrator_from(const std::vector<std::string>& labels, const Doubles& xyz_mm,
                                    const Doubles& diameters_mm, const std::string& name, double tolerance_mm,
                                    double scale_sigma, const std::optional<Doubles>& covariance_mm2) {
  const auto points = rows_of<3>(xyz_mm, "xyz_mm");
  const bool one_size = diameters_mm.ndim() == 0;
  check_finite(diameters_mm, "diameters_mm");
  if (points.size() != labels.size() ||
      (!one_size && (diameters_mm.ndim() != 1 || std::size_t(diameters_mm.size()) != labels.size())))
    raise({Reason::bad_value,
           fmt::format("labels, xyz_mm and diameters_mm differ in length: {}, {} and {}", labels.size(),
                       points.size(), diameters_mm.size()),
           {},
           {}});
  Json json = {{"name", name}, {"balls", Json::array()}};
  for (std::size_t i = 0; i < labels.size(); ++i)
    json["balls"].push_back({{"label", labels[i]},
                             {"xyz_mm", json_row(points[i].data(), 3)},
                             {"diameter_mm", diameters_mm.data()[one_size ? 0 : i]}});
  json["tolerance_mm"] = checked(tolerance_mm, any_number, "tolerance_mm");
  json["scale_sigma"] = checked(scale_sigma, any_number, "scale_sigma");
  if (covariance_mm2) set_covariance(json, *covariance_mm2, labels);
  return value_or_raise(phantom::calibrator_from_json(json, "from_arrays"));
}

/// As calibrate takes it.
py::object ball_covariance(const phantom::Calibrator& calibrator) {
  const Eigen::MatrixXd joint = phantom::joint_ball_covariance(calibrator);
  if (joint.size() > 0) return read_only(matrix_array(joint));
  const auto own = phantom::ball_covariances(calibrator);
  if (own.empty()) return py::none();
  py::array_t<double> array({py::ssize_t(own.size()), py::ssize_t{3}, py::ssize_t{3}});
  for (std::size_t i = 0; i < own.size(); ++i)
    Eigen::Map<Eigen::Matrix3d>(array.mutable_data(py::ssize_t(i), 0, 0)) = own[i];
  return read_only(array);
}

phantom::Plate plate_from(const Doubles& xy_mm, double diameter_mm, std::optional<double> pitch_mm,
                          const std::string& kind, const std::string& lattice,
                          std::optional<double> height_above_receiver_mm, const std::string& name) {
  const auto if_given = [](std::optional<double> value, const char* argument) {
    return checked(value, any_number, argument) ? Json(*value) : Json(nullptr);
  };
  const auto dots = rows_of<2>(xy_mm, "xy_mm");
  const Json json = {
      {"name", name},
      {"kind", kind},
      {"lattice", lattice},
      {"pitch_mm", if_given(pitch_mm, "pitch_mm")},
      {"diameter_mm", checked(diameter_mm, any_number, "diameter_mm")},
      {"dots_xy_mm", json_rows(dots.empty() ? nullptr : dots[0].data(), py::ssize_t(dots.size()), 2)},
      {"height_above_receiver_mm", if_given(height_above_receiver_mm, "height_above_receiver_mm")}};
  return value_or_raise(phantom::plate_from_json(json, "from_arrays"));
}

template <class T>
void save(const T& thing, const std::filesystem::path& path) {
  value_or_raise(write_file(path, to_text(phantom::to_json(thing)) + "\n"));
}

void add_calibrator(py::module_& module) {
  py::class_<phantom::Calibrator>(
      module, "Calibrator", "The phantom: balls at known positions, and check targets (calibrator.json).")
      .def_static("udcsc", &phantom::udcsc,
                  "The built-in calibrator: twelve 4 mm balls on the conical helix of Eq. 9.")
      .def_static(
          "load",
          [](const std::filesystem::path& path) { return value_or_raise(phantom::read_calibrator(path)); },
          py::arg("path"), "Reads calibrator.json. Raises InputError; RefusedError: coplanar_fiducials.")
      .def_static(
          "from_dict",
          [](const py::object& dict) {
            return value_or_raise(phantom::calibrator_from_json(json_from(dict), "dict"));
          },
          py::arg("dict"), "From the content of calibrator.json; lists may be NumPy arrays. Raises as load.")
      .def_static("from_arrays", &calibrator_from, py::arg("labels"), py::arg("xyz_mm"),
                  py::arg("diameters_mm"), py::kw_only(), py::arg("name") = "phantom",
                  py::arg("tolerance_mm") = phantom::Calibrator{}.tolerance_mm,
                  py::arg("scale_sigma") = phantom::Calibrator{}.scale_sigma,
                  py::arg("covariance_mm2") = py::none(),
                  R"(From N labels, (N, 3) centres, mm, and diameters, mm, one number or (N,).

tolerance_mm: standard deviation of the positions per axis; scale_sigma: relative, of all lengths; covariance_mm2:
(N, 3, 3), or (3 N, 3 N) of all balls together, with the scale's error. Raises as load.)")
      .def(
          "to_dict", [](const phantom::Calibrator& c) { return python_from(phantom::to_json(c)); },
          "The content of calibrator.json.")
      .def("save", &save<phantom::Calibrator>, py::arg("path"),
           "Writes calibrator.json. Raises InputError: cannot_write.")
      .def_readonly("name", &phantom::Calibrator::name)
      .def_property_readonly("labels", &labels)
      .def_property_readonly(
          "xyz_mm", [](const phantom::Calibrator& c) { return read_only(centres(c)); },
          "(N, 3) centres of the balls, calibrator frame, mm; read only.")
      .def_property_readonly(
          "diameters_mm", [](const phantom::Calibrator& c) { return read_only(diameters(c)); },
          "(N,) mm; read only.")
      .def_property_readonly(
          "ball_covariance_mm2", &ball_covariance,
          R"(As calibrate takes it, beside scale_sigma: (3 N, 3 N), or (N, 3, 3), mm^2, or None.

Of the file's covariances without the scale's error, plus the tolerance; None: every ball is exact.)")
      .def_readonly("tolerance_mm", &phantom::Calibrator::tolerance_mm,
                    "Standard deviation of the balls' positions per axis, mm.")
      .def_readonly("scale_sigma", &phantom::Calibrator::scale_sigma,
                    "Relative standard deviation of all lengths; 0: not stated.")
      .def_property_readonly(
          "targets",
          [](const phantom::Calibrator& c) {
            return python_from(phantom::to_json(c).value("targets", Json::array()));
          },
          "Check points, as in calibrator.json.")
      .def("__repr__", [](const phantom::Calibrator& c) {
        return fmt::format("<Calibrator {}: {} balls>", c.name, c.balls.size());
      });
}

void add_plate(py::module_& module) {
  py::class_<phantom::Plate>(module, "Plate",
                             "The rectification plate in front of the receiver (plate.json).")
      .def_static("plate48", &phantom::plate48,
                  "The built-in plate: 7 x 7 balls of 2.5 mm at 25 mm pitch, without the central one.")
      .def_static(
          "load", [](const std::filesystem::path& path) { return value_or_raise(phantom::read_plate(path)); },
          py::arg("path"), "Reads plate.json. Raises InputError.")
      .def_static(
          "from_dict",
          [](const py::object& dict) {
            return value_or_raise(phantom::plate_from_json(json_from(dict), "dict"));
          },
          py::arg("dict"), "From the content of plate.json; lists may be NumPy arrays. Raises InputError.")
      .def_static("from_arrays", &plate_from, py::arg("xy_mm"), py::kw_only(), py::arg("diameter_mm"),
                  py::arg("pitch_mm"), py::arg("kind") = "balls", py::arg("lattice") = "square",
                  py::arg("height_above_receiver_mm") = py::none(), py::arg("name") = "plate",
                  R"(From (N, 2) dots in the plate's plane, mm: +x right, +y down as seen from the source.

kind: balls or holes; lattice: square or hexagonal. Raises InputError.)")
      .def(
          "to_dict", [](const phantom::Plate& p) { return python_from(phantom::to_json(p)); },
          "The content of plate.json.")
      .def("save", &save<phantom::Plate>, py::arg("path"),
           "Writes plate.json. Raises InputError: cannot_write.")
      .def_readonly("name", &phantom::Plate::name)
      .def_readonly("pitch_mm", &phantom::Plate::pitch_mm)
      .def_readonly("diameter_mm", &phantom::Plate::diameter_mm)
      .def_readonly("height_above_receiver_mm", &phantom::Plate::height_above_receiver_mm)
      .def_property_readonly(
          "xy_mm", [](const phantom::Plate& p) { return read_only(rows_array<2>(p.dots_mm)); },
          "(N, 2) dots in the plate's plane, mm: +x right, +y down as seen from the source; (0, 2): "
          "unbounded.")
      .def("__repr__", [](const phantom::Plate& p) {
        return fmt::format("<Plate {}: {} dots>", p.name, p.dots_mm.size());
      });
}

}  // namespace

void add_phantom(py::module_& module) {
  add_calibrator(module);
  add_plate(module);
}

}  // namespace helicarm::python
