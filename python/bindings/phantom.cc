// SPDX-License-Identifier: Apache-2.0
#include "arrays.h"
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
          py::arg("dict"), "From the content of calibrator.json. Raises as load.")
      .def(
          "to_dict", [](const phantom::Calibrator& c) { return python_from(phantom::to_json(c)); },
          "The content of calibrator.json.")
      .def("save", &save<phantom::Calibrator>, py::arg("path"),
           "Writes calibrator.json. Raises InputError: cannot_write.")
      .def_readonly("name", &phantom::Calibrator::name)
      .def_property_readonly("labels", &labels)
      .def_property_readonly("xyz_mm", &centres, "(N, 3) centres of the balls, calibrator frame, mm.")
      .def_property_readonly("diameters_mm", &diameters, "(N,)")
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
          py::arg("dict"), "From the content of plate.json. Raises InputError.")
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
          "xy_mm", [](const phantom::Plate& p) { return rows_array<2>(p.dots_mm); },
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
