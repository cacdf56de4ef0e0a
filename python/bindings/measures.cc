// SPDX-License-Identifier: Apache-2.0
#include <map>

#include "arrays.h"
#include "checks.h"
#include "held_calibration.h"
#include "helicarm/fiducials/find_target.h"
#include "helicarm/localization/pick_checks.h"
#include "helicarm/measures/measure_json.h"
#include "module.h"

namespace helicarm::python {
namespace {

/// The calibrated view in which clicks lie.
struct InView {
  const HeldCalibration& calibration;
  std::size_t index;

  const calibration::CalibratedView& view() const { return calibration.views[index]; }
};

using Points = std::map<std::string, std::pair<Doubles, Doubles>>;

std::optional<measures::ObjectPlane> plane_of(const InView& in, std::optional<double> depth_mm,
                                              double depth_sigma_mm, const std::optional<Doubles>& at) {
  if (depth_mm && at) raise({Reason::usage, "depth_mm and at cannot be combined", {}, {}});
  if (depth_mm)
    return measures::plane_at(in.view(), *checked(depth_mm, positive, "depth_mm"),
                              checked(depth_sigma_mm, not_negative, "depth_sigma_mm"));
  if (at) return value_or_raise(measures::plane_through(in.view(), row_of<3>(*at, "at")));
  const auto& fiducials = in.calibration.fiducials;
  if (in.index >= fiducials.size() || fiducials[in.index].empty()) return std::nullopt;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const fiducials::Fiducial& one : fiducials[in.index]) sum += one.centre_in_calibrator;
  return value_or_raise(measures::plane_through(in.view(), sum / double(fiducials[in.index].size())));
}

measures::Click click_at(const std::string& name, const Eigen::Vector2d& uv, std::optional<double> sigma_px,
                         const std::optional<InView>& in, bool raw) {
  fiducials::ImagePoint point{uv, uv, sigma_px.value_or(fiducials::click_sigma_px)};
  if (raw) {
    const auto& map = in ? in->calibration.maps[in->index] : std::nullopt;
    if (!map)
      raise({Reason::usage, "raw=True requires a calibration whose view has a distortion map", {}, {}});
    point = value_or_raise(fiducials::point_of_click(*map, uv, sigma_px));
  }
  return {name, point.uv, point.sigma_px * point.sigma_px * Eigen::Matrix2d::Identity()};
}

std::optional<Warning> taken_as_rectified(const std::map<std::string, Doubles>& clicks, const InView& in) {
  std::vector<localization::PointObservation> picks;
  for (const auto& [name, uv] : clicks)
    picks.push_back({in.index, row_of<2>(uv, name), Eigen::Matrix2d::Zero()});
  return localization::pixels_taken_as_rectified(picks, in.calibration);
}

py::dict measure(const std::string& word, const std::map<std::string, Doubles>& clicks,
                 const HeldCalibration* calibration, const std::optional<ViewKey>& view,
                 std::optional<double> sigma_px, bool raw, std::optional<double> depth_mm,
                 double depth_sigma_mm, const std::optional<Doubles>& at, const Points& points) {
  std::vector<std::string_view> words;
  for (const measures::KindInfo& info : measures::kinds()) words.push_back(info.word);
  const auto kind = measures::kinds()[checked_word(word, words, "kind")].kind;
  checked(sigma_px, not_negative, "sigma_px");
  if ((calibration != nullptr) != view.has_value())
    raise({Reason::usage, "calibration and view are given together", {}, {}});
  if (calibration == nullptr && (depth_mm || at || !points.empty()))
    raise({Reason::usage, "depth_mm, at and points require a calibration and view", {}, {}});
  std::optional<InView> in;
  if (calibration != nullptr) in.emplace(InView{*calibration, calibration->index_of(*view)});
  std::vector<measures::Click> all;
  for (const auto& [name, uv] : clicks) all.push_back(click_at(name, row_of<2>(uv, name), sigma_px, in, raw));
  for (const auto& [name, point] : points)
    all.push_back(value_or_raise(
        measures::click_of(name, row_of<3>(point.first, name),
                           checked_covariance(matrix_of(point.second, 3, 3, name), name), in->view().view)));
  const auto plane = in ? plane_of(*in, depth_mm, depth_sigma_mm, at) : std::nullopt;
  const measures::Measure found = value_or_raise(measures::measure(kind, all, plane));
  py::dict result = python_from(measures::to_json(found));
  for (std::size_t i = 0; i < found.positions.size(); ++i) {
    py::list warnings;
    for (const Warning& warning : found.positions[i].warnings) warnings.append(warning_dict(warning));
    result["positions"][py::int_(i)]["warnings"] = warnings;
  }
  py::list notes;
  if (const auto note = in && !raw ? taken_as_rectified(clicks, *in) : std::nullopt)
    notes.append(warning_dict(*note));
  result["notes"] = notes;
  return result;
}

}  // namespace

void add_measures(py::module_& module) {
  module.def(
      "measure", &measure, py::arg("kind"), py::arg("clicks"), py::kw_only(),
      py::arg("calibration") = nullptr, py::arg("view") = py::none(), py::arg("sigma_px") = py::none(),
      py::arg("raw") = false, py::arg("depth_mm") = py::none(), py::arg("depth_sigma_mm") = 0.0,
      py::arg("at") = py::none(), py::arg("points") = Points{},
      R"(A distance, angle, circle or positions of points in femur or tibia, in one image, with standard deviations.

kind and clicks, {name: (u, v)}:
  distance: from, to; angle: first, vertex, second; line_angle: line1_from, line1_to, line2_from, line2_to;
  circle: rim1, rim2, rim3 and any further ones;
  femoral_quadrants: blumensaat_posterior, blumensaat_anterior, inferior[, posterior, anterior] (Bernard and Hertel):
    depth 0 % at the posterior border, height 0 % on Blumensaat's line;
  tibia_ap: anterior, posterior[, plateau1, plateau2]: per cent from the anterior margin; tibia_ml: medial, lateral.
In the last three, clicks of other names are points, given in per cent; so are points, {name: (xyz_mm (3,),
covariance_mm2 (3, 3))} in the calibrator frame, by their projections.
calibration, view: lengths are then in mm, in the plane parallel to the detector depth_mm from the source, or through
at (3,), or through the fiducials' centre; without, in pixels. sigma_px: of a click per axis; not given: 0.5. raw: the
clicks are raw pixels. Returns {"kind", "depth_mm", "quantities": [{"name", "unit", "value", "sigma"}], "positions":
[{"point", "percent": {component: value}, "covariance_percent2", "warnings": [outside_reference]}], "notes":
[pixels_taken_as_rectified]}. Raises InputError: usage, bad_value (clicks missing,
unknown, or that do not determine the measure); RefusedError: behind_source, not_seen.)");
}

}  // namespace helicarm::python
