// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "arrays.h"
#include "checks.h"
#include "held_calibration.h"
#include "helicarm/calibration/calibrate.h"
#include "helicarm/calibration/labelled_views.h"
#include "helicarm/core/files.h"
#include "helicarm/phantom/calibrator_limits.h"
#include "module.h"

namespace helicarm::python {

std::size_t HeldCalibration::index_of(const ViewKey& key) const {
  for (std::size_t i = 0; i < views.size(); ++i)
    if (key == ViewKey(i) || key == ViewKey(views[i].name)) return i;
  const std::string text = std::holds_alternative<std::string>(key)
                               ? '"' + std::get<std::string>(key) + '"'
                               : std::to_string(std::get<std::size_t>(key));
  std::vector<std::string> names;
  for (const calibration::CalibratedView& view : views) names.push_back(view.name);
  raise({Reason::bad_value,
         fmt::format("view: the calibration has no view {}, it has {}", text, fmt::join(names, ", ")),
         {},
         {}});
}

namespace {

using Labels = std::vector<std::string>;

/// Row of the given covariance for each fiducial of the views.
std::vector<py::ssize_t> covariance_rows(const Labels& ball_labels,
                                         const std::vector<fiducials::Fiducial>& fiducials) {
  std::vector<py::ssize_t> rows;
  for (const fiducials::Fiducial& fiducial : fiducials) {
    const auto found = std::ranges::find(ball_labels, fiducial.label);
    if (found == ball_labels.end())
      raise({Reason::bad_value, fmt::format("ball_labels: \"{}\" is missing", fiducial.label), {}, {}});
    if (std::find(found + 1, ball_labels.end(), fiducial.label) != ball_labels.end())
      raise({Reason::name_clash, fmt::format("ball_labels: \"{}\" is given twice", fiducial.label), {}, {}});
    rows.push_back(found - ball_labels.begin());
  }
  return rows;
}

/// The labels in the covariance's order; without `given`, of a first view that has all balls.
Labels labels_of_covariance(const std::optional<Labels>& given, const std::vector<ViewPoints>& views,
                            const std::vector<fiducials::Fiducial>& all) {
  if (given) return *given;
  if (views[0].fiducials.size() != all.size())
    raise(
        {Reason::usage,
         fmt::format("ball_covariance_mm2: the first view lacks {}: give ball_labels, the label of each row",
                     all[views[0].fiducials.size()].label),
         views[0].name,
         {}});
  Labels labels;
  for (const fiducials::Fiducial& fiducial : all) labels.push_back(fiducial.label);
  return labels;
}

/// Of B balls: (B, 3, 3), each ball's own, or (3 B, 3 B), of all together.
void set_ball_covariance(const Doubles& mm2, py::ssize_t balls, const std::vector<py::ssize_t>& rows,
                         calibration::CommonPrior& common) {
  constexpr const char* name = "ball_covariance_mm2";
  if (mm2.ndim() == 2 && mm2.shape(0) == 3 * balls && mm2.shape(1) == 3 * balls) {
    const Eigen::MatrixXd all = checked_covariance(matrix_of(mm2, 3 * balls, 3 * balls, name), name);
    std::vector<Eigen::Index> elements;
    for (const py::ssize_t row : rows)
      for (const Eigen::Index axis : {0, 1, 2}) elements.push_back(3 * row + axis);
    common.joint_ball_covariance_mm2 = all(elements, elements);
    return;
  }
  if (mm2.ndim() != 3 || mm2.shape(0) != balls || mm2.shape(1) != 3 || mm2.shape(2) != 3)
    raise({Reason::bad_value,
           fmt::format("{}: shape {} is neither ({}, 3, 3) nor ({}, {}) of {} balls", name, shape_of(mm2),
                       balls, 3 * balls, 3 * balls, balls),
           {},
           {{"balls", double(balls)}}});
  check_finite(mm2, name);
  for (const py::ssize_t row : rows)
    common.ball_covariance_mm2.emplace_back(checked_covariance(
        Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(mm2.data(row, 0, 0)),
        fmt::format("{}: row {}", name, row)));
}

Eigen::Vector3d middle_of(const std::vector<fiducials::Fiducial>& fiducials) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const fiducials::Fiducial& fiducial : fiducials) sum += fiducial.centre_in_calibrator;
  return sum / double(fiducials.size());
}

/// As run_case checks its views.
void check_views(const std::vector<ViewPoints>& views, double least_angle_deg, HeldCalibration& held) {
  if (views.size() > 1)
    value_or_raise(calibration::check_views_apart(held.views, middle_of(held.fiducials[0]), least_angle_deg));
  std::vector<std::optional<bool>> mirrored;
  for (const ViewPoints& view : views) mirrored.push_back(view.mirrored);
  for (Warning& warning : value_or_raise(calibration::check_handedness(held.views, mirrored)))
    held.warnings.push_back(std::move(warning));
}

HeldCalibration calibrated(const std::vector<ViewPoints>& views, const calibration::CArmPrior& c_arm,
                           const std::optional<Doubles>& ball_covariance_mm2,
                           const std::optional<Labels>& ball_labels, double scale_sigma,
                           double rejection_probability, double largest_rms_px, double least_angle_deg) {
  if (views.empty())
    raise({Reason::bad_value, "views: is empty, at least one is required", {}, {{"value", 0}, {"limit", 1}}});
  calibration::CalibrationOptions options{
      {c_arm, {}, {}, checked(scale_sigma, within(phantom::scale_sigma_range), "scale_sigma")},
      checked(rejection_probability, within(calibration::rejection_range), "rejection_probability"),
      checked(largest_rms_px, positive, "largest_rms_px")};
  checked(least_angle_deg, {0, 90}, "least_angle_deg");
  const auto aligned = value_or_raise(
      calibration::aligned_by_label(std::vector<calibration::ViewFiducials>(views.begin(), views.end())));
  const auto& all = aligned[0].fiducials;
  if (ball_covariance_mm2) {
    const Labels labels = labels_of_covariance(ball_labels, views, all);
    set_ball_covariance(*ball_covariance_mm2, py::ssize_t(labels.size()), covariance_rows(labels, all),
                        options.common);
  }
  calibration::CalibrationResult result =
      value_or_raise(without_gil([&] { return calibration::calibrate(aligned, options); }));
  HeldCalibration held;
  static_cast<calibration::Calibration&>(held) = result;
  for (const ViewPoints& view : views) held.maps.push_back(view.map);
  held.warnings = std::move(result.warnings);
  check_views(views, least_angle_deg, held);
  return held;
}

HeldCalibration loaded(const std::filesystem::path& path) {
  return {value_or_raise(calibration::saved_calibration_from_json(value_or_raise(read_json(path)),
                                                                  path.filename().string())),
          {}};
}

using Held = HeldCalibration;

/// Files of earlier versions have no chi-square.
template <class Number>
std::optional<Number> if_known(const Held& calibration, Number value) {
  return calibration.dof > 0 ? std::optional(value) : std::nullopt;
}

std::string words_of_held(const Held& calibration) {
  std::vector<std::string> names;
  for (const calibration::CalibratedView& view : calibration.views) names.push_back(view.name);
  std::string text = fmt::format("<Calibration of {}", fmt::join(names, ", "));
  if (calibration.dof > 0) text += fmt::format(": chi2 / dof {:.1f} / {}", calibration.chi2, calibration.dof);
  for (const Warning& warning : calibration.warnings)
    text += fmt::format(", warning {}", code(warning.reason));
  return text + ">";
}

void add_parameters(py::class_<Held>& held) {
  const auto view_of = [](const Held& c, const ViewKey& key) -> const calibration::CalibratedView& {
    return c.views[c.index_of(key)];
  };
  held.def(
          "projection",
          [=](const Held& c, const ViewKey& v) { return matrix_array(view_of(c, v).view.projection()); },
          py::arg("view"),
          "(3, 4) calibrator (mm) to homogeneous pixels; the third row's first part has unit norm.")
      .def(
          "intrinsics",
          [=](const Held& c, const ViewKey& v) {
            return matrix_array(view_of(c, v).view.intrinsics.matrix());
          },
          py::arg("view"), "(3, 3) K, pixels; fx < 0 in a mirrored image.")
      .def(
          "camera_from_calibrator",
          [=](const Held& c, const ViewKey& v) {
            return matrix_array(view_of(c, v).view.camera_from_world.matrix());
          },
          py::arg("view"), "(4, 4) mm; camera: origin at the X-ray source, z towards the detector.")
      .def(
          "covariance",
          [=](const Held& c, const ViewKey& v) { return matrix_array(view_of(c, v).covariance); },
          py::arg("view"),
          "(11, 11) of fx, fy, u0, v0 (px), rotation vector in the camera frame (rad), translation (mm), "
          "skew.")
      .def_property_readonly(
          "joint_covariance", [](const Held& c) { return read_only(matrix_array(c.joint_covariance)); },
          "(11 n, 11 n) of all n views' parameters; (0, 0): not computed.")
      .def(
          "map", [](const Held& c, const ViewKey& v) { return c.maps[c.index_of(v)]; }, py::arg("view"),
          "The view's DistortionMap, or None where the pixels were given free of distortion.")
      .def(
          "fiducials",
          [](const Held& c, const ViewKey& v) {
            const std::size_t view = c.index_of(v);
            return view < c.fiducials.size() ? fiducial_list(c.fiducials[view]) : py::list();
          },
          py::arg("view"),
          "List of {label, status, xyz_mm, uv_raw, uv, sigma_px, residual_px}, one for each ball of any "
          "view; "
          "empty in files of earlier versions.")
      .def_property_readonly(
          "chi2", [](const Held& c) { return if_known(c, c.chi2); },
          "Of the fiducials' residuals in all views; None in files of earlier versions.")
      .def_property_readonly(
          "dof", [](const Held& c) { return if_known(c, c.dof); }, "Degrees of freedom of chi2, or None.")
      .def_property_readonly(
          "variance_scale", [](const Held& c) { return if_known(c, c.variance_scale); },
          "chi2 / dof where the residuals exceed the sigmas by more than three standard deviations: "
          "all covariances are multiplied by it; else 1. None in files of earlier versions.")
      .def_property_readonly(
          "warnings", [](const Held& c) { return warning_list(c.warnings); },
          "List of {code, message, view, figures}; not saved.");
}

}  // namespace

void add_calibration(py::module_& module) {
  add_view_points(module);
  add_points(module);
  py::class_<Held> held(module, "Calibration", R"(Views calibrated together; all that points are located by.

World: calibrator frame, mm. Pixels: rectified unless raw=True. A view is given by its name or index.)");
  held.def_static("load", &loaded, py::arg("path"),
                  "From a file of save, or result.json of a run that was not refused. Raises InputError.")
      .def_static(
          "from_dict",
          [](const py::object& given) -> Held {
            return {value_or_raise(calibration::saved_calibration_from_json(json_from(given), "dict")), {}};
          },
          py::arg("dict"), "Of to_dict. Raises InputError.")
      .def(
          "to_dict", [](const Held& c) { return python_from(calibration::to_json(c)); },
          "The content of the file that save writes.")
      .def(
          "save",
          [](const Held& c, const std::filesystem::path& path) {
            value_or_raise(write_file(path, to_text(calibration::to_json(c)) + "\n"));
          },
          py::arg("path"),
          "Writes views, covariance, maps and fiducials (helicarm-calibration/1). Raises InputError: "
          "cannot_write.")
      .def_property_readonly("names",
                             [](const Held& c) {
                               std::vector<std::string> names;
                               for (const auto& view : c.views) names.push_back(view.name);
                               return names;
                             })
      .def("__len__", [](const Held& c) { return c.views.size(); })
      .def("__repr__", &words_of_held);
  add_point_methods(held);
  add_parameters(held);
  const calibration::CalibrationOptions usual;
  module.def("calibrate", &calibrated, py::arg("views"), py::kw_only(), py::arg("c_arm") = usual.common.c_arm,
             py::arg("ball_covariance_mm2") = py::none(), py::arg("ball_labels") = py::none(),
             py::arg("scale_sigma") = usual.common.scale_sigma,
             py::arg("rejection_probability") = usual.rejection_probability,
             py::arg("largest_rms_px") = usual.largest_rms_px,
             py::arg("least_angle_deg") = calibration::least_view_angle_deg,
             R"(Pinhole views by maximum likelihood, all ViewPoints at once, under their priors.

Points of several views with one label are images of one ball; a view may lack balls. c_arm: CArmPrior that all views
share. ball_covariance_mm2: of B balls (B, 3, 3), or (3 B, 3 B) of all together, mm^2, without the scale's error
(Calibrator.ball_covariance_mm2); ball_labels: the B labels of its rows; not given: those of the first view, which then
has every ball. scale_sigma: relative, of the calibrator, 0 to 0.1. Outliers are found by tests at
rejection_probability, 0 to 0.1 (0: none). Refused above largest_rms_px (and 3 sigma). least_angle_deg: of two views or
more, between the two farthest apart, 0 to 90. Returns a Calibration. Releases the GIL.
Raises InputError: bad_value, not_finite, name_clash, usage; RefusedError: too_few_fiducials, coplanar_fiducials,
behind_source, uncertain, residual_too_large, views_too_close, ambiguous_handedness (all views mirrored, unstated).)");
}

}  // namespace helicarm::python
