// SPDX-License-Identifier: Apache-2.0
#include <map>

#include "arrays.h"
#include "checks.h"
#include "held_calibration.h"
#include "helicarm/case_registration/bone_measures.h"
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

using Coordinates = std::map<std::string, std::optional<Doubles>>;

measures::LandmarkSet landmark_set(const std::string& word, const Coordinates& landmarks,
                                   const std::string& model, double sigma_mm) {
  std::vector<std::string_view> words;
  std::vector<measures::Kind> kinds;
  for (const measures::KindInfo& info : measures::kinds())
    if (!info.components.empty()) words.push_back(info.word), kinds.push_back(info.kind);
  measures::LandmarkSet set{word, model, kinds[checked_word(word, words, "kind")]};
  for (const auto& [name, at] : landmarks) {
    measures::TableLandmark each{name, {}, "landmarks"};
    if (at)
      each.landmark =
          measures::Landmark{name, row_of<3>(*at, name), sigma_mm * sigma_mm * Eigen::Matrix3d::Identity()};
    set.landmarks.push_back(std::move(each));
  }
  return set;
}

py::dict measure_landmarks(const std::string& word, const Coordinates& landmarks, double sigma_mm,
                           const py::object& registration, const std::optional<std::string>& model,
                           const HeldCalibration* calibration, const Points& points,
                           const std::optional<std::filesystem::path>& zones) {
  checked(sigma_mm, not_negative, "sigma_mm");
  case_registration::BoneScene scene;
  scene.zones = value_or_raise(measures::zones_of(zones));
  if (!registration.is_none())
    scene.models =
        value_or_raise(case_registration::posed_models_from(json_from(registration), "registration"));
  if (!model && scene.models.size() > 1)
    raise({Reason::usage, "model is required: the registration has several models", {}, {}});
  const std::string name = model ? *model : scene.models.empty() ? "" : scene.models.front().name;
  measures::LandmarkSet set = landmark_set(word, landmarks, name, sigma_mm);
  for (const auto& [point, value] : points) {
    if (!landmarks.contains(point)) set.landmarks.push_back({point, {}, "points"});
    scene.located[point] = {row_of<3>(value.first, point),
                            checked_covariance(matrix_of(value.second, 3, 3, point), point)};
  }
  if (calibration != nullptr) scene.views = case_registration::views_of(*calibration);
  return python_from(measures::to_json(value_or_raise(measured_in_bone(set, scene))));
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
  module.def(
      "measure_landmarks", &measure_landmarks, py::arg("kind"), py::arg("landmarks"), py::kw_only(),
      py::arg("sigma_mm") = 0.0, py::arg("registration") = py::none(), py::arg("model") = py::none(),
      py::arg("calibration") = nullptr, py::arg("points") = Points{}, py::arg("zones") = py::none(),
      R"(Quadrants and the tibial per cent from landmarks in a bone's CT, in three dimensions, as `helicarm measure --landmarks`.

kind: femoral_quadrants, tibia_ap or tibia_ml. landmarks: {name: (3,) mm in the model (a CT: LPS), or None: a point of the
model's plan in registration, or one of points}; names as of measure, and axis_medial, axis_lateral: points that coincide
in a true lateral image (not of tibia_ml). Other names are points, given in per cent. sigma_mm: of a coordinate per axis.
registration: the content of registration.json, such as register returns; model: one of its models, the only one if not
given. points: {name: (xyz_mm (3,), covariance_mm2 (3, 3))} in the calibrator frame, carried into the model with the
registration's error. calibration: its views within 30 degrees of a lateral one are compared with it; the registration is of the same views,
or the case of each has the poses of the marker on the bone. zones: a zones.json in place of the built-in published positions.
Returns {"name", "model", "view": None, "kind", "depth_mm": None, "quantities", "positions": [{"point", "percent",
"covariance_percent2", "zones": [{"name", "source", "from_centre_percent", "outside"}], "warnings"}], "laterals": [{"view",
"off_deg", "apart_mm", "is_lateral", "message", "positions"}], "clicked": [], "missing": []}. Raises InputError: usage,
bad_value (landmarks missing, unknown, or that do not determine the measure; a point that is not known), and as a file's.)");
}

}  // namespace helicarm::python
