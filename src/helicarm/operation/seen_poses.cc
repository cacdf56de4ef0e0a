// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/seen_poses.h"

#include <chrono>
#include <numbers>
#include <thread>

#include <fmt/format.h>

namespace helicarm {
namespace {

/// A picture of 2 MiB over a hospital's network, and its preparation in the C-arm.
constexpr double longest_way_s = 1.5;
constexpr double now_window_s = 0.25;

/// What the tracker keeps in every reading, about the marker's own origin.
PoseCovariance kept_by_tracker(const TrackerPlan& plan) {
  const double turn = plan.sigma_deg * std::numbers::pi / 180;
  PoseCovariance covariance = PoseCovariance::Zero();
  covariance.diagonal().head<3>().setConstant(plan.sigma_mm * plan.sigma_mm);
  covariance.diagonal().tail<3>().setConstant(turn * turn);
  return covariance;
}

ExposurePoseOptions exposure_window() {
  ExposurePoseOptions options;
  options.window_s = longest_way_s / 2;
  return options;
}

/// Waits until the window about a moment just gone is full on both sides.
double settled_now() {
  const double now = monotonic_seconds();
  std::this_thread::sleep_for(std::chrono::duration<double>(2 * now_window_s));
  return now + now_window_s;
}

ExposurePoseOptions now_options() {
  ExposurePoseOptions options;
  options.window_s = now_window_s;
  return options;
}

Expected<std::optional<RigidTransform>> bone_if_seen(const Expected<SeenPose>& seen) {
  if (seen) return seen->tracker_from_marker;
  if (seen.error().reason == Reason::pose_spread) return tl::unexpected<Failure>(seen.error());
  return std::nullopt;
}

}  // namespace

Expected<SeenPose> see_tool(const PoseBoard& board, const TrackerPlan& plan, const std::string& tool,
                            double time_s, const ExposurePoseOptions& options) {
  return board.at(tool, time_s, options).map([&](const ExposurePose& pose) {
    return SeenPose{pose.tracker_from_tool, pose.covariance + kept_by_tracker(plan)};
  });
}

Expected<SeenPose> see_calibrator(const PoseBoard& board, const TrackerPlan& plan, double time_s,
                                  const ExposurePoseOptions& options) {
  std::vector<FacetPose> seen;
  std::optional<Failure> why_not;
  for (const Facet& facet : plan.facets) {
    const auto pose = see_tool(board, plan, facet.name, time_s, options);
    if (pose)
      seen.push_back({facet.name, pose->tracker_from_marker, pose->covariance});
    else if (!why_not || pose.error().reason == Reason::pose_spread)
      why_not = pose.error();
  }
  if (why_not && (seen.empty() || why_not->reason == Reason::pose_spread))
    return tl::unexpected<Failure>(*why_not);
  return fuse_facets(plan.facets, seen).map([](const FusedPose& fused) {
    return SeenPose{fused.tracker_from_calibrator, fused.covariance};
  });
}

Expected<Poses> poses_of_exposure(const PoseBoard& board, const TrackerPlan& plan, double arrival_s) {
  return guarded([&] {
    const ExposurePoseOptions window = exposure_window();
    const double middle = arrival_s - window.window_s;
    Poses poses;
    poses.tracker_from_calibrator =
        value_or_throw(see_calibrator(board, plan, middle, window)).tracker_from_marker;
    poses.tracker_from_femur =
        value_or_throw(bone_if_seen(see_tool(board, plan, plan.femur, middle, window)));
    poses.tracker_from_tibia =
        value_or_throw(bone_if_seen(see_tool(board, plan, plan.tibia, middle, window)));
    return poses;
  });
}

Expected<Poses> poses_now(const PoseBoard& board, const TrackerPlan& plan) {
  return guarded([&] {
    const double now = settled_now();
    const auto see = [&](const std::string& tool) {
      return value_or_throw(see_tool(board, plan, tool, now, now_options())).tracker_from_marker;
    };
    Poses poses;
    poses.tracker_from_femur = see(plan.femur);
    poses.tracker_from_tibia = see(plan.tibia);
    poses.tracker_from_tool = see(plan.tool);
    return poses;
  });
}

TrackerNoise noise_of(const TrackerPlan& plan) {
  return {plan.sigma_mm, plan.sigma_deg, Samples::independent};
}

}  // namespace helicarm
