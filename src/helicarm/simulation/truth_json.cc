// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/truth_json.h"

#include <algorithm>

#include "helicarm/simulation/wire_grid.h"

namespace helicarm::simulation {
namespace {

const char* word(Visibility visibility) {
  switch (visibility) {
    case Visibility::clear:
      return "clear";
    case Visibility::hidden:
      return "hidden";
    case Visibility::outside:
      return "outside";
    case Visibility::absent:
      return "absent";
  }
  return "";
}

Json points_json(const std::vector<TruePoint>& points) {
  Json list = Json::array();
  for (const TruePoint& point : points)
    list.push_back({{"name", point.name},
                    {"xyz_mm", vector_json(point.in_calibrator)},
                    {"ideal", vector_json(point.ideal)},
                    {"raw", vector_json(point.raw)},
                    {"visibility", word(point.visibility)}});
  return list;
}

Json distortion_json(const VirtualDetector& detector) {
  const IntensifierDistortion& distortion = detector.distortion;
  Json bumps = Json::array();
  for (const DistortionBump& bump : distortion.bumps)
    bumps.push_back({{"centre_px", vector_json(bump.centre_px)},
                     {"sigma_px", bump.sigma_px},
                     {"shift_px", vector_json(bump.shift_px)}});
  return {{"centre_px", vector_json(distortion.centre_px)},
          {"radius_px", distortion.radius_px},
          {"k1", distortion.k1},
          {"k2", distortion.k2},
          {"s_rotation_rad", distortion.s_rotation},
          {"shift_px", vector_json(distortion.shift_px)},
          {"bumps", bumps}};
}

Json imaging_json(const Imaging& imaging) {
  return {{"quanta_per_pixel", imaging.quanta_per_pixel},
          {"electronic_noise", imaging.electronic_noise},
          {"scatter_fraction", imaging.scatter_fraction},
          {"scatter_sigma_px", imaging.scatter_sigma_px},
          {"focus_sigma_px", imaging.focus_sigma_px},
          {"screen_sigma_px", imaging.screen_sigma_px},
          {"vignette", imaging.vignette},
          {"open_level", imaging.open_level}};
}

Json view_json(const SimulatedView& view, const char* world) {
  const TrueView& true_view = view.true_view;
  const geometry::View stored = true_view.stored_view();
  Json json = {{"name", true_view.name},
               {"image_size", {true_view.detector.width, true_view.detector.height}},
               {"mirrored", true_view.mirrored},
               {"camera",
                {{"f_mm", true_view.f_mm},
                 {"pixel_mm", true_view.detector.pixel_mm},
                 {"K", matrix_json(stored.intrinsics.matrix())},
                 {std::string("camera_from_") + world, matrix_json(stored.camera_from_world.matrix())},
                 {"projection", matrix_json(stored.projection())}}},
               {"angles_deg", {true_view.true_angles.primary_deg, true_view.true_angles.secondary_deg}},
               {"imaging", imaging_json(true_view.imaging)},
               {"field_radius_px", nullptr},
               {"distortion", distortion_json(true_view.detector)},
               {"balls", points_json(view.balls)},
               {"targets", points_json(view.targets)},
               {"tunnel_points", points_json(view.tunnel_points)},
               {"plate", points_json(view.plate_dots)}};
  if (!view.crosses.empty()) json["crosses"] = points_json(view.crosses);
  if (true_view.detector.field_radius_px) json["field_radius_px"] = *true_view.detector.field_radius_px;
  return json;
}

/// Distances (ideal pixels) of the tunnel's true ends from the tool line's image.
Json line_errors_px(const TrueToolLine& line, const NavigationTruth& truth, const TrueView& true_view) {
  const geometry::View view = true_view.stored_view();
  const auto flat = [&](const Eigen::Vector3d& point) {
    const Eigen::Vector2d pixel = view.project(point);
    return Eigen::Vector3d(pixel.x(), pixel.y(), 0);
  };
  const auto error = [&](const std::string& name) {
    const auto point = std::find_if(truth.points.begin(), truth.points.end(),
                                    [&](const TunnelPoint& each) { return each.name == name; });
    return distance_to_line(flat(point->in_calibrator), flat(line.p1_in_calibrator),
                            flat(line.p2_in_calibrator));
  };
  return {{"start", error(line.start)}, {"end", error(line.end)}};
}

Json navigation_json(const SimulatedCase& simulated) {
  const NavigationTruth& truth = *simulated.navigation;
  Json json;
  for (const auto& [frame, pose] : truth.tracker_from)
    json["poses"]["tracker_from_" + frame] = matrix_json(pose.matrix());
  const TrackerModel tracker = virtual_tracker();
  json["tracker"] = {{"marker_sigma_mm", vector_json(tracker.marker_sigma_mm)},
                     {"drift_sigma_mm", vector_json(tracker.drift_sigma_mm)},
                     {"samples_per_reading", samples_per_reading},
                     {"rate_hz", tracker_rate_hz}};
  for (const auto& [frame, covariance] : truth.covariance)
    json["tracker"]["covariance"]["tracker_from_" + frame] = matrix_json(covariance);
  for (const TunnelPoint& point : truth.points)
    json["points"].push_back({{"name", point.name},
                              {"bone", point.bone},
                              {"in_calibrator", vector_json(point.in_calibrator)},
                              {"in_bone", vector_json(point.in_bone)},
                              {"in_tool", vector_json(point.in_tool)}});
  for (const TrueToolLine& line : truth.lines) {
    Json entry = {{"name", line.name},
                  {"start", line.start},
                  {"end", line.end},
                  {"start_error_mm", line.start_error_mm},
                  {"end_error_mm", line.end_error_mm}};
    for (const SimulatedView& view : simulated.views)
      entry["error_px"][view.true_view.name] = line_errors_px(line, truth, view.true_view);
    json["tool_lines"].push_back(entry);
  }
  return json;
}

}  // namespace

Json vector_json(const Eigen::VectorXd& vector) { return std::vector<double>(vector.begin(), vector.end()); }

Json matrix_json(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) rows.push_back(vector_json(matrix.row(row)));
  return rows;
}

Json truth_json(const SimulatedCase& simulated) {
  Json json = {{"format", "helicarm-truth/1"},
               {"kind", word(simulated.options.kind)},
               {"preset", word(simulated.options.c_arm_preset())},
               {"seed", simulated.options.seed},
               {"arm_seed", simulated.options.arm_seed.value_or(simulated.options.seed)},
               {"knee", simulated.options.knee},
               {"response", word(simulated.options.logarithmic() ? Response::logarithmic : Response::linear)},
               {"bits", simulated.options.bits},
               {"faults", Json::array()},
               {"lost_balls", simulated.options.lost_balls},
               {"note",
                "ideal: pixels without distortion; raw: stored pixels. distortion maps raw to ideal before "
                "any mirroring "
                "(u -> width - 1 - u)"},
               {"views", Json::array()}};
  const bool grid = simulated.options.kind == CaseKind::grid;
  if (grid) {
    const WireGrid wires;
    json["grid"] = {{"wires", wires.wires},
                    {"pitch_mm", wires.pitch_mm},
                    {"thickness_mm", wires.thickness_mm},
                    {"distances_mm", simulated.options.grid_distances_mm}};
  }
  for (Fault fault : simulated.options.faults) json["faults"].push_back(word(fault));
  for (const SimulatedView& view : simulated.views)
    json["views"].push_back(view_json(view, grid ? "grid" : "calibrator"));
  for (const phantom::CalibratorTarget& target : simulated.calibrator.targets)
    json["targets_in_calibrator"][target.name] = vector_json(target.point_in_calibrator);
  if (simulated.calibrator_from_ct) {
    const volume::Volume& volume = simulated.options.ct->volume;
    json["ct"] = {{"file", simulated.options.ct->name},
                  {"digest", volume::volume_key(volume)},
                  {"size", volume.size},
                  {"patient_from_voxel", matrix_json(volume.patient_from_voxel.matrix())},
                  {"calibrator_from_patient", matrix_json(simulated.calibrator_from_ct->matrix())}};
  }
  if (simulated.navigation) json["navigation"] = navigation_json(simulated);
  return json;
}

}  // namespace helicarm::simulation
