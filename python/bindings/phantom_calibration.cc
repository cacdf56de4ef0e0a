// SPDX-License-Identifier: Apache-2.0
#include <tuple>
#include <variant>

#include "arrays.h"
#include "checks.h"
#include "helicarm/phantom_calibration/measure_phantom.h"
#include "helicarm/phantom_calibration/phantom_report.h"
#include "helicarm/phantom_calibration/verify_phantom.h"
#include "helicarm/sweep/sweep_case.h"
#include "module.h"
#include "signals.h"

namespace helicarm::python {
namespace {

using phantom_calibration::MeasuredBall;
using phantom_calibration::PhantomResult;
using BallName = std::variant<std::string, std::pair<double, double>>;
using Distance = std::tuple<BallName, BallName, double>;

phantom_calibration::FiducialName fiducial(const BallName& name) {
  if (const auto* label = std::get_if<std::string>(&name)) return *label;
  const auto& [u, v] = std::get<std::pair<double, double>>(name);
  return Eigen::Vector2d(u, v);
}

PhantomResult measured(const std::filesystem::path& folder, const std::vector<Distance>& distances,
                       const std::string& distance_is, double distance_sigma_mm, bool from_scratch,
                       unsigned threads, const py::object& progress) {
  static constexpr std::array<std::string_view, 2> kinds{"centres", "outer"};
  phantom_calibration::PhantomOptions options;
  options.outer = checked_word(distance_is, kinds, "distance_is") == 1;
  for (const auto& [a, b, mm] : distances)
    options.distances.push_back({fiducial(a), fiducial(b), checked(mm, positive, "distances: mm")});
  options.distance_sigma_mm = checked(distance_sigma_mm, positive, "distance_sigma_mm");
  options.from_scratch = from_scratch;
  options.threads = threads;
  options.date = phantom_calibration::today();
  const RunHooks hooks = run_hooks(progress);
  options.on_stage = hooks.on_stage;
  options.on_view = hooks.on_view;
  PhantomResult result = value_or_raise(without_gil([&] {
    return sweep::read_phantom_case(folder).and_then([&](const pipeline::Case& the_case) {
      return phantom_calibration::measure_phantom(the_case, options);
    });
  }));
  if (result.failure) raise(*result.failure, py::cast(result));
  return result;
}

py::object verified(const std::filesystem::path& folder, const std::optional<std::filesystem::path>& history,
                    unsigned threads) {
  phantom_calibration::PhantomVerification result = value_or_raise(without_gil([&] {
    return pipeline::read_case(folder).and_then([&](const pipeline::Case& the_case) {
      return phantom_calibration::verify_phantom(the_case, threads);
    });
  }));
  result.date = phantom_calibration::today();
  if (history && !result.balls.empty()) value_or_raise(phantom_calibration::add_to_history(*history, result));
  py::object content = python_from(phantom_calibration::to_json(result));
  if (result.failure) raise(*result.failure, content);
  return content;
}

template <class Get>
std::vector<Eigen::Vector3d> of_balls(const PhantomResult& result, const Get& get) {
  std::vector<Eigen::Vector3d> rows;
  for (const MeasuredBall& ball : result.balls) rows.push_back(get(ball));
  return rows;
}

py::array covariances(const PhantomResult& result) {
  py::array_t<double> array({py::ssize_t(result.balls.size()), py::ssize_t{3}, py::ssize_t{3}});
  for (std::size_t i = 0; i < result.balls.size(); ++i)
    Eigen::Map<Eigen::Matrix3d>(array.mutable_data(py::ssize_t(i), 0, 0)) = result.balls[i].covariance_mm2;
  return array;
}

void add_measured_phantom(py::module_& module) {
  py::class_<PhantomResult>(module, "MeasuredPhantom",
                            "The balls of a phantom as built, from X-ray images of it.")
      .def_readonly("calibrator", &PhantomResult::calibrator,
                    "Calibrator with the measured balls and their covariances.")
      .def_property_readonly("labels",
                             [](const PhantomResult& r) {
                               std::vector<std::string> labels;
                               for (const MeasuredBall& ball : r.balls) labels.push_back(ball.label);
                               return labels;
                             })
      .def_property_readonly(
          "xyz_mm",
          [](const PhantomResult& r) {
            return read_only(
                rows_array<3>(of_balls(r, [](const MeasuredBall& ball) { return ball.centre; })));
          },
          "(N, 3) centres, mm, in the nominal calibrator frame; from scratch: in their principal axes.")
      .def_property_readonly(
          "covariance_mm2", [](const PhantomResult& r) { return read_only(covariances(r)); },
          "(N, 3, 3) mm^2, with the scale's error: not for calibrate, which takes "
          "calibrator.ball_covariance_mm2 and calibrator.scale_sigma.")
      .def_property_readonly(
          "from_nominal_mm",
          [](const PhantomResult& r) {
            return read_only(rows_array<3>(of_balls(r, [](const MeasuredBall& ball) {
              return ball.from_nominal.value_or(
                  Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
            })));
          },
          "(N, 3) differences from the nominal file, mm; NaN from scratch.")
      .def_property_readonly(
          "scale_source", [](const PhantomResult& r) { return r.scale.source; },
          "\"distances\" or \"diameters\".")
      .def_property_readonly(
          "scale_sigma", [](const PhantomResult& r) { return r.scale.relative_sigma; },
          "Relative standard deviation of all lengths.")
      .def_readonly("rms_px", &PhantomResult::rms_px, "Of the reprojection, per axis, all views.")
      .def_readonly("chi2", &PhantomResult::chi2)
      .def_readonly("dof", &PhantomResult::dof)
      .def_property_readonly("warnings", [](const PhantomResult& r) { return warning_list(r.warnings); })
      .def_property_readonly(
          "notes", [](const PhantomResult& r) { return warning_list(r.notes); },
          "Limitations of this kind of measurement, such as a single distance that nothing checks.")
      .def(
          "to_dict", [](const PhantomResult& r) { return python_from(phantom_calibration::to_json(r)); },
          "The content of result.json.")
      .def(
          "write",
          [](const PhantomResult& r, const std::filesystem::path& folder) {
            value_or_raise(without_gil([&] { return phantom_calibration::write_phantom(r, folder); }));
          },
          py::arg("folder"), "calibrator.json, result.json and report.html. Raises InputError: cannot_write.")
      .def("__repr__", [](const PhantomResult& r) {
        if (r.failure) return fmt::format("<MeasuredPhantom: refused, {}>", code(r.failure->reason));
        std::string text = fmt::format(
            "<MeasuredPhantom: {} balls, {} views, {:.3f} px rms, scale from {}, sigma {:.2g} %",
            r.balls.size(), r.views.size(), r.rms_px, r.scale.source, 100 * r.scale.relative_sigma);
        for (const Warning& warning : r.warnings) text += fmt::format(", warning {}", code(warning.reason));
        return text + ">";
      });
}

}  // namespace

void add_phantom_calibration(py::module_& module) {
  add_measured_phantom(module);
  const phantom_calibration::PhantomOptions usual;
  module.def("measure_phantom", &measured, py::arg("folder"), py::kw_only(),
             py::arg("distances") = std::vector<Distance>(), py::arg("distance_is") = "centres",
             py::arg("distance_sigma_mm") = usual.distance_sigma_mm,
             py::arg("from_scratch") = usual.from_scratch, py::arg("threads") = usual.threads,
             py::arg("progress") = py::none(),
             R"(Measures the balls of a phantom by bundle adjustment of three or more X-ray images of it.

folder: holds case.json; its calibrator is the nominal file. distances: (a, b, mm) measured by hand, which give the
scale, between two labels or, from_scratch, two raw (u, v) in the first view; distance_is: "centres", or "outer" for a
caliper over both balls; distance_sigma_mm: of each. from_scratch: only the balls' diameters are known, which case.json
states as diameters_mm. progress: called with the name of each stage (read, rectify, detect, adjust) before it begins;
an exception from it ends the measurement, and Ctrl-C does between two views before adjust. Releases the GIL. Returns a
MeasuredPhantom. Raises InputError; RefusedError with .result, which holds all that was computed until then.)");
  module.def("verify_phantom", &verified, py::arg("folder"), py::kw_only(), py::arg("history") = py::none(),
             py::arg("threads") = usual.threads,
             R"(Whether the balls are where the case's calibrator file has them, from two views or more.

history: a JSON file that keeps the results of all dates; made where there is none. Releases the GIL. Returns the
content of result.json: the state, distance and 95 % limit of each ball. Raises InputError; RefusedError
(calibrator_mismatch, too_few_views) with the same content as .result.)");
}

}  // namespace helicarm::python
