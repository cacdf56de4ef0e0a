// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/simulated_scene.h"

#include <algorithm>
#include <stdexcept>

#include <fmt/format.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::virtual_devices {
namespace {

using Eigen::Vector3d;
using simulation::MarkerFacet;
using simulation::TrackedBody;

/// The base stands beside the knee at the height of the table's edge, x towards the patient, z up (the knee's
/// anterior side): both tunnels' axes are within the arm's reach.
const geometry::RigidTransform calibrator_from_base{
    (Eigen::Matrix3d() << 0, 1, 0, -1, 0, 0, 0, 0, 1).finished(), {60, 520, -160}};

/// Rotates z onto the direction.
Eigen::Matrix3d facing(const Vector3d& direction) {
  return geometry::rotation_between(Vector3d::UnitZ(), direction);
}

const phantom::CalibratorBall* ball_named(const phantom::Calibrator& calibrator, const std::string& label) {
  const auto ball = std::ranges::find(calibrator.balls, label, &phantom::CalibratorBall::label);
  return ball == calibrator.balls.end() ? nullptr : &*ball;
}

/// Pointer on a ball: its marker faces the tracker within 30 degrees, and successive touches come from three
/// sides, all from the tracker's half.
Eigen::Matrix3d pointer_at(const Vector3d& ball_in_tracker, int touch) {
  constexpr double tilt_rad = 0.5;
  return facing(-ball_in_tracker) * (Eigen::AngleAxisd(touch * 2 * EIGEN_PI / 3, Vector3d::UnitZ()) *
                                     Eigen::AngleAxisd(tilt_rad, Vector3d::UnitX()))
                                        .toRotationMatrix();
}

}  // namespace

Expected<std::unique_ptr<SimulatedScene>> SimulatedScene::set_up(
    std::uint64_t seed, int image_size, std::shared_ptr<const simulation::CtOptions> ct) {
  simulation::SimulationOptions options;
  options.seed = seed;
  options.kind = simulation::CaseKind::tunnels;
  options.size = image_size;
  options.ct = std::move(ct);
  auto simulated_case = simulation::simulate_case(options);
  if (!simulated_case) return tl::unexpected<Failure>(simulated_case.error());
  return std::unique_ptr<SimulatedScene>(new SimulatedScene(*std::move(simulated_case)));
}

SimulatedScene::SimulatedScene(simulation::SimulatedCase simulated_case)
    : simulated_case_(std::move(simulated_case)), tracker_from_(simulated_case_.navigation->tracker_from) {
  tracker_from_base_ = tracker_from_.at("calibrator") * calibrator_from_base;
}

geometry::RigidTransform SimulatedScene::tracker_from(const std::string& body) const {
  const std::lock_guard lock(mutex_);
  return tracker_from_.at(body);
}

geometry::RigidTransform SimulatedScene::tracker_from_marker(const std::string& bone) const {
  const std::lock_guard lock(mutex_);
  geometry::RigidTransform pose = tracker_from_.at(bone);
  if (const auto bumped = marker_in_bone_.find(bone); bumped != marker_in_bone_.end())
    pose.translation = pose * bumped->second;
  return pose;
}

void SimulatedScene::bump_marker(const std::string& bone, const Vector3d& shift_mm) {
  const std::lock_guard lock(mutex_);
  marker_in_bone_.try_emplace(bone, Vector3d::Zero()).first->second += shift_mm;
}

geometry::RigidTransform SimulatedScene::tracker_from_pointer() const {
  const auto [touched, touches] = [&] {
    const std::lock_guard lock(mutex_);
    return std::pair(touched_, touches_);
  }();
  if (const auto* ball = ball_named(simulated_case_.calibrator, touched)) {
    const Vector3d centre = tracker_from("calibrator") * ball->centre_in_calibrator;
    const Eigen::Matrix3d turn = pointer_at(centre, touches);
    const Vector3d side = (turn * -tip_in_pointer).normalized();
    return {turn, centre + ball->diameter_mm / 2 * side - turn * tip_in_pointer};
  }
  const Eigen::Matrix3d turn = tracker_from(touched).rotation;  // as observed by the tracker
  return {turn, point_in_tracker(touched == "femur" ? "FE" : "TS") - turn * tip_in_pointer};
}

bool SimulatedScene::touch(const std::string& what) {
  if (what != "femur" && what != "tibia" && !ball_named(simulated_case_.calibrator, what)) return false;
  const std::lock_guard lock(mutex_);
  touched_ = what;
  ++touches_;
  return true;
}

void SimulatedScene::move_bone(const std::string& bone, const geometry::RigidTransform& motion_in_tracker) {
  const std::lock_guard lock(mutex_);
  geometry::RigidTransform& pose = tracker_from_.at(bone);
  pose = {motion_in_tracker.rotation * pose.rotation, pose.translation + motion_in_tracker.translation};
}

void SimulatedScene::turn_bone(const std::string& bone, const Vector3d& about, const Eigen::Matrix3d& turn) {
  const std::lock_guard lock(mutex_);
  geometry::RigidTransform& pose = tracker_from_.at(bone);
  pose = {turn * pose.rotation, about + turn * (pose.translation - about)};
}

geometry::RigidTransform SimulatedScene::tracker_from_base() const {
  const std::lock_guard lock(mutex_);
  return tracker_from_base_;
}

void SimulatedScene::move_base(const Vector3d& shift_mm) {
  const std::lock_guard lock(mutex_);
  tracker_from_base_.translation += shift_mm;
}

Vector3d SimulatedScene::point_in_tracker(const std::string& name) const {
  const auto point =
      std::ranges::find(simulated_case_.navigation->points, name, &simulation::TunnelPoint::name);
  if (point == simulated_case_.navigation->points.end()) throw std::invalid_argument("no point " + name);
  return tracker_from(point->bone) * point->in_bone;
}

robot::RobotTool SimulatedScene::tool() const { return {{Eigen::Matrix3d::Identity(), {0, 0, 150}}, 1.2}; }

geometry::RigidTransform SimulatedScene::flange_from_marker() const {
  // Manually clamped to the drill's side.
  return {Eigen::AngleAxisd(0.35, Vector3d(0.2, 0.9, -0.4).normalized()).toRotationMatrix(), {12, 70, 40}};
}

TrackedBody tool_markers() {
  TrackedBody body;
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      const Vector3d normal = side * Vector3d::Unit(axis);
      MarkerFacet facet{normal, {}};
      for (const auto& [x, y] : {std::pair{-30.0, -24.0}, {28.0, -30.0}, {22.0, 30.0}, {-18.0, 16.0}})
        facet.markers_in_body.push_back(facing(normal) * Vector3d(x, y, 30));
      body.facets.push_back(facet);
    }
  return body;
}

std::vector<TrackedFacet> calibrator_facets() {
  std::vector<TrackedFacet> facets;
  for (const MarkerFacet& facet : simulation::calibrator_markers().facets) {
    Vector3d middle = Vector3d::Zero();
    for (const Vector3d& marker : facet.markers_in_body)
      middle += marker / double(facet.markers_in_body.size());
    const geometry::RigidTransform calibrator_from_facet{facing(facet.normal_in_body), middle};
    MarkerFacet own{Vector3d::UnitZ(), {}};
    for (const Vector3d& marker : facet.markers_in_body)
      own.markers_in_body.push_back(calibrator_from_facet.inverse() * marker);
    facets.push_back({fmt::format("calibrator/{}", facets.size() + 1), calibrator_from_facet, {{own}}});
  }
  return facets;
}

}  // namespace helicarm::virtual_devices
