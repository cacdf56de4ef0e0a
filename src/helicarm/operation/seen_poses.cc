// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/seen_poses.h"

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "helicarm/geometry/view_json.h"

namespace helicarm::operation {
namespace {

/// Transfer of an image through the C-arm and a hospital network.
constexpr double longest_way_s = 1.5;
constexpr double now_s = 0.75;  // a stop request ends the wait within 1 s
/// The last samples of a window that ends now arrive this late.
constexpr double settle_s = 0.1;
/// A leg is not moved and brought back within so short a time.
constexpr double longest_gap_s = 0.25;

constexpr Range any_time{0, 1e12};
constexpr Range sample_range{-1e6, 1e6};

std::vector<std::string> tools_of(const TrackerPlan& plan) {
  std::vector<std::string> tools{plan.tool};
  for (const auto& [bone, marker] : plan.markers) tools.push_back(marker);
  if (plan.pointer) tools.push_back(plan.pointer->name);
  for (const tracker::Facet& facet : plan.facets) tools.push_back(facet.name);
  return tools;
}

PoseWindow window_about(const tracker::PoseBoard& board, const TrackerPlan& plan, double middle_s,
                        double half_s) {
  PoseWindow window{middle_s, half_s, {}};
  for (const std::string& tool : tools_of(plan))
    window.samples[tool] = board.between(tool, middle_s - half_s, middle_s + half_s);
  return window;
}

/// Tracker error that averaging does not reduce, about the marker's origin.
tracker::PoseCovariance systematic_covariance(const TrackerPlan& plan) {
  const double turn = plan.sigma_deg * std::numbers::pi / 180;
  tracker::PoseCovariance covariance = tracker::PoseCovariance::Zero();
  covariance.diagonal().head<3>().setConstant(plan.sigma_mm * plan.sigma_mm);
  covariance.diagonal().tail<3>().setConstant(turn * turn);
  return covariance;
}

Expected<std::optional<geometry::RigidTransform>> bone_if_seen(const Expected<SeenPose>& seen) {
  if (seen) return seen->tracker_from_marker;
  if (seen.error().reason == Reason::pose_spread) return tl::unexpected<Failure>(seen.error());
  return std::nullopt;
}

/// The longest gap between samples within the window.
double longest_gap(const PoseWindow& window, const std::vector<tracker::PoseSample>& samples) {
  double last = window.middle_s - window.half_s, gap = 0;
  for (const tracker::PoseSample& sample : samples)
    gap = std::max(gap, sample.time_s - std::exchange(last, sample.time_s));
  return std::max(gap, window.middle_s + window.half_s - last);
}

Failure named(Failure failure, const std::string& tool) {
  failure.message = tool + ": " + failure.message;
  return failure;
}

}  // namespace

Json to_json(const PoseWindow& window) {
  Json tools = Json::object();
  for (const auto& [tool, samples] : window.samples) {
    Json& list = tools[tool] = Json::array();
    for (const tracker::PoseSample& sample : samples)
      list.push_back({{"time_s", sample.time_s},
                      {"device_s", sample.device_s},
                      {"arrival_s", sample.arrival_s},
                      {"tracker_from_tool", geometry::json_rows(sample.tracker_from_tool.matrix())}});
  }
  return {{"middle_s", window.middle_s}, {"half_s", window.half_s}, {"tools", std::move(tools)}};
}

Expected<PoseWindow> pose_window_from(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    PoseWindow window{reader.number("middle_s", any_time), reader.number("half_s", {0, 60}), {}};
    const Json& tools = reader.raw("tools");
    if (!tools.is_object()) reader.refuse(Reason::bad_value, "tools", "must be an object");
    for (const auto& [tool, list] : tools.items()) {
      if (!list.is_array()) reader.refuse(Reason::bad_value, "tools", "must contain lists");
      std::vector<tracker::PoseSample>& samples = window.samples[tool];
      for (const Json& entry : list) {
        JsonReader sample(entry, fmt::format("{}: {}", origin, tool));
        const double time = sample.number("time_s", any_time), device = sample.number("device_s", any_time);
        const double arrival = sample.number("arrival_s", any_time);
        const geometry::RigidTransform pose =
            geometry::exact_pose_from(sample, "tracker_from_tool", sample_range);
        sample.finish();
        samples.push_back({time, device, arrival, pose});
      }
    }
    reader.finish();
    return window;
  });
}

PoseWindow window_of_exposure(const tracker::PoseBoard& board, const TrackerPlan& plan, double arrival_s,
                              double coarse_s) {
  const double half_s = (longest_way_s + coarse_s) / 2;
  return window_about(board, plan, arrival_s - half_s, half_s);
}

PoseWindow window_now(const tracker::PoseBoard& board, const TrackerPlan& plan, const std::stop_token& end) {
  const double from = tracker::monotonic_seconds();
  std::mutex alone;
  std::unique_lock lock(alone);
  std::condition_variable_any().wait_for(lock, end, std::chrono::duration<double>(now_s + settle_s),
                                         [] { return false; });
  if (end.stop_requested()) throw BadInput(Reason::interrupted, "stopped by request");
  return window_about(board, plan, from + now_s / 2, now_s / 2);
}

Expected<SeenPose> see_tool(const PoseWindow& window, const TrackerPlan& plan, const std::string& tool) {
  const auto samples = window.samples.find(tool);
  if (samples == window.samples.end())
    return fail(Reason::no_pose, tool + ": no pose from the tracker in this window");
  if (const double gap = longest_gap(window, samples->second);
      !samples->second.empty() && gap > longest_gap_s)
    return fail(Reason::stale_pose,
                fmt::format("{}: was not visible for {:.3g} s, limit {:g} s", tool, gap, longest_gap_s),
                {{"gap_s", gap}});
  tracker::ExposurePoseOptions options;
  options.window_s = window.half_s;
  return tracker::exposure_pose(samples->second, window.middle_s, options)
      .map([&](const tracker::ExposurePose& pose) {
        return SeenPose{pose.tracker_from_tool, pose.covariance,
                        pose.covariance + systematic_covariance(plan)};
      })
      .map_error([&](const Failure& failure) { return named(failure, tool); });
}

bool is_seen_at_end(const PoseWindow& window, const std::string& marker) {
  const auto samples = window.samples.find(marker);
  return samples != window.samples.end() && !samples->second.empty() &&
         window.middle_s + window.half_s - samples->second.back().time_s <= longest_gap_s;
}

Expected<SeenPose> see_calibrator(const PoseWindow& window, const TrackerPlan& plan) {
  std::vector<tracker::FacetPose> seen;
  std::optional<Failure> why_not;
  for (const tracker::Facet& facet : plan.facets) {
    const auto pose = see_tool(window, plan, facet.name);
    if (pose)
      seen.push_back({facet.name, pose->tracker_from_marker, pose->covariance});
    else if (!why_not || why_not->reason == Reason::no_pose || pose.error().reason == Reason::pose_spread)
      why_not = pose.error();
  }
  if (why_not && (seen.empty() || why_not->reason == Reason::pose_spread))
    return tl::unexpected<Failure>(*why_not);
  return tracker::fuse_facets(plan.facets, seen).map([](const tracker::FusedPose& fused) {
    return SeenPose{fused.tracker_from_calibrator, fused.covariance, fused.covariance};
  });
}

Expected<guidance::Poses> poses_of_exposure(const PoseWindow& window, const TrackerPlan& plan) {
  return guarded([&] {
    guidance::Poses poses;
    poses.tracker_from_calibrator = value_or_throw(see_calibrator(window, plan)).tracker_from_marker;
    for (const auto& [bone, marker] : plan.markers)
      if (const auto seen = value_or_throw(bone_if_seen(see_tool(window, plan, marker))))
        poses.tracker_from_bone.emplace(bone, *seen);
    return poses;
  });
}

Expected<guidance::Poses> poses_now(const PoseWindow& window, const TrackerPlan& plan) {
  return guarded([&] {
    const auto see = [&](const std::string& tool) {
      return value_or_throw(see_tool(window, plan, tool)).tracker_from_marker;
    };
    guidance::Poses poses;
    for (const auto& [bone, marker] : plan.markers) poses.tracker_from_bone.emplace(bone, see(marker));
    poses.tracker_from_tool = see(plan.tool);
    return poses;
  });
}

Expected<Eigen::Vector3d> touched_in_bone(const PoseWindow& window, const TrackerPlan& plan,
                                          const guidance::Bone& bone) {
  return guarded([&]() -> Eigen::Vector3d {
    if (!plan.pointer) throw BadInput(Reason::bad_value, "the plan has no pointer; add it to \"tracker\"");
    const auto see = [&](const std::string& tool) {
      return value_or_throw(see_tool(window, plan, tool)).tracker_from_marker;
    };
    const Eigen::Vector3d tip = see(plan.pointer->name) * plan.pointer->tip_in_pointer;
    return see(plan.marker_of(bone)).inverse() * tip;
  });
}

}  // namespace helicarm::operation
