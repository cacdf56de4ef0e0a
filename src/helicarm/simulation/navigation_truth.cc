// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/navigation_truth.h"

#include <algorithm>
#include <cmath>

#include "helicarm/simulation/knee.h"
#include "helicarm/simulation/random_pose.h"
#include "helicarm/simulation/streams.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector3d;

/// Random pose around a position in the tracker's frame, with an orientation visible to the tracker.
geometry::RigidTransform somewhere(const TrackedBody& body, const Vector3d& position, double spread_mm,
                                   RandomStream& random) {
  for (;;) {
    const geometry::RigidTransform pose{random_rotation(random),
                                        position + random_motion(random, 0, spread_mm).translation};
    if (pose_covariance(virtual_tracker(), body, pose)) return pose;
  }
}

/// Draws the readings and records their actual rms error.
void read_poses(NavigationTruth& truth, const std::map<std::string, TrackedBody>& bodies,
                std::uint64_t seed) {
  const TrackerModel model = virtual_tracker();
  double turn2 = 0;
  double shift2 = 0;
  std::uint32_t number = 0;
  for (const auto& [frame, pose] : truth.tracker_from) {
    const TrackedBody& body = bodies.at(frame);
    std::vector<double> times = steady_times(tracker_rate_hz, samples_per_reading);
    const auto at_rest = [&](double) { return pose; };
    const auto samples = track(model, body, at_rest, times, seed, stream::readings + 2 * number++);
    const auto seen = std::ranges::count_if(samples, &TrackerSample::valid);
    truth.read[frame] = mean_pose(samples).value();
    truth.covariance[frame] = *pose_covariance(model, body, pose, static_cast<int>(seen));
    turn2 += truth.covariance[frame].diagonal().head<3>().mean() / static_cast<double>(bodies.size());
    shift2 += truth.covariance[frame].diagonal().tail<3>().mean() / static_cast<double>(bodies.size());
  }
  truth.sigma_deg = std::sqrt(turn2) / radian;
  truth.sigma_mm = std::sqrt(shift2);
}

/// A drilled line: normal deviation from the tunnel of 0.5 mm per axis, 40 mm before its start and at half
/// its length.
TrueToolLine missed(const std::string& name, const TunnelPoint& start, const TunnelPoint& end,
                    RandomStream& random) {
  const Vector3d axis = (end.in_calibrator - start.in_calibrator).normalized();
  TrueToolLine line{name,
                    start.name,
                    end.name,
                    start.in_calibrator - 40 * axis,
                    0.5 * (start.in_calibrator + end.in_calibrator),
                    0,
                    0};
  line.p1_in_calibrator += random_motion(random, 0, 0.5).translation;
  line.p2_in_calibrator += random_motion(random, 0, 0.5).translation;
  line.start_error_mm = distance_to_line(start.in_calibrator, line.p1_in_calibrator, line.p2_in_calibrator);
  line.end_error_mm = distance_to_line(end.in_calibrator, line.p1_in_calibrator, line.p2_in_calibrator);
  return line;
}

}  // namespace

double distance_to_line(const Vector3d& point, const Vector3d& a, const Vector3d& b) {
  return (point - a).cross(b - a).norm() / (b - a).norm();
}

TrackerModel virtual_tracker() {
  TrackerModel model;
  model.drift_sigma_mm = {0.07, 0.07, 0.17};
  model.drift_time_s = 15;
  model.lost_sample = 0.02;
  model.nearest_mm = 300;  // the markers are about 900 mm away and up to 300 mm from each other
  model.half_field_deg = 50;
  return model;
}

NavigationTruth set_up_navigation(std::uint64_t seed, const geometry::RigidTransform& calibrator_from_knee) {
  RandomStream random(seed, stream::tracker);
  NavigationTruth truth;
  std::map<std::string, TrackedBody> bodies;
  for (const char* frame : {"femur", "tibia", "tool"}) bodies[frame] = marker_array();
  bodies["calibrator"] = calibrator_markers();
  const geometry::RigidTransform tracker_from_calibrator =
      somewhere(bodies["calibrator"], {-80, -60, 900}, 40, random);
  // Markers on both bones at a distance from the joint, the tool beside the knee.
  truth.tracker_from["calibrator"] = tracker_from_calibrator;
  const auto beside = [&](const char* frame, const Vector3d& in_calibrator, double spread_mm) {
    truth.tracker_from[frame] =
        somewhere(bodies[frame], tracker_from_calibrator * in_calibrator, spread_mm, random);
  };
  beside("femur", {-130, 20, 60}, 10);
  beside("tibia", {120, -20, 50}, 10);
  beside("tool", {80, -220, 160}, 30);
  read_poses(truth, bodies, seed);

  const geometry::RigidTransform tool_from_calibrator =
      truth.tracker_from["tool"].inverse() * tracker_from_calibrator;
  const auto add = [&](const char* name, const char* bone, const Vector3d& in_knee) {
    const Vector3d in_calibrator = calibrator_from_knee * in_knee;
    const Vector3d in_bone = truth.tracker_from[bone].inverse() * (tracker_from_calibrator * in_calibrator);
    truth.points.push_back({name, bone, in_calibrator, in_bone, tool_from_calibrator * in_calibrator});
  };
  add("FS", "femur", femoral_tunnel().start);
  add("FE", "femur", femoral_tunnel().end);
  add("TS", "tibia", tibial_tunnel().start);
  add("TE", "tibia", tibial_tunnel().end);
  truth.lines.push_back(missed("femur", truth.points[0], truth.points[1], random));
  truth.lines.push_back(missed("tibia", truth.points[2], truth.points[3], random));
  return truth;
}

}  // namespace helicarm::simulation
