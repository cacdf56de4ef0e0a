// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/navigation_truth.h"

#include "helicarm/simulation/knee.h"
#include "helicarm/simulation/random_pose.h"
#include "helicarm/simulation/streams.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector3d;

/// Somewhere around a place, turned any way.
RigidTransform somewhere(const Vector3d& place, double spread_mm, RandomStream& random) {
  RigidTransform pose = random_motion(random, 0, spread_mm);
  return {random_rotation(random), place + pose.translation};
}

/// A drilled line: the tunnel's, missed by a normal 0.5 mm per axis 40 mm before its start and half way
/// through.
ToolLine missed(const std::string& name, const TunnelPoint& start, const TunnelPoint& end,
                RandomStream& random) {
  const Vector3d axis = (end.in_calibrator - start.in_calibrator).normalized();
  ToolLine line{name,
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

NavigationTruth set_up_navigation(std::uint64_t seed, const RigidTransform& calibrator_from_knee) {
  RandomStream random(seed, stream::tracker);
  NavigationTruth truth;
  const RigidTransform tracker_from_calibrator = somewhere({-80, -60, 900}, 40, random);
  // Markers on both bones some way from the joint, the tool beside the knee.
  truth.tracker_from["calibrator"] = tracker_from_calibrator;
  truth.tracker_from["femur"] = tracker_from_calibrator * somewhere({-130, 20, 60}, 10, random);
  truth.tracker_from["tibia"] = tracker_from_calibrator * somewhere({120, -20, 50}, 10, random);
  truth.tracker_from["tool"] = tracker_from_calibrator * somewhere({80, -220, 160}, 30, random);
  for (const auto& [frame, pose] : truth.tracker_from)
    truth.read[frame] = pose * random_motion(random, truth.sigma_deg, truth.sigma_mm);

  const RigidTransform tool_from_calibrator = truth.tracker_from["tool"].inverse() * tracker_from_calibrator;
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
