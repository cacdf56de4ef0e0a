// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <stop_token>
#include <string>
#include <vector>

#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/operation/plan.h"

namespace helicarm {

/// What the tracker said of every tool about one moment (monotonic seconds).
struct PoseWindow {
  double middle_s = 0;
  double half_s = 0;
  std::map<std::string, std::vector<PoseSample>> samples;
};

Json to_json(const PoseWindow& window);
/// To the last bit. Fails as JsonReader.
Expected<PoseWindow> pose_window_from(const Json& json, const std::string& origin);

/// The second and a half before an image came: the acquisition lies somewhere in it. Longer by what the time
/// of the acquisition is coarse, as its delay is then known no better.
PoseWindow window_of_exposure(const PoseBoard& board, const TrackerPlan& plan, double arrival_s,
                              double coarse_s = 0);
/// The three quarters of a second from now on; waits until they are over.
/// Throws BadInput (interrupted) when told to end meanwhile.
PoseWindow window_now(const PoseBoard& board, const TrackerPlan& plan, const std::stop_token& end);

/// A marker at rest over a window.
struct SeenPose {
  RigidTransform tracker_from_marker;
  PoseCovariance scatter;  ///< of the mean, from its samples
  PoseCovariance
      covariance;  ///< with what no averaging over so short a time takes away (TrackerPlan's sigmas)
};

/// Refuses as `exposure_pose`: not seen, seen only in a part of the window, moved.
Expected<SeenPose> see_tool(const PoseWindow& window, const TrackerPlan& plan, const std::string& tool);

/// From whichever of its facets are seen. Refuses as `fuse_facets`, and where one of them moved.
Expected<SeenPose> see_calibrator(const PoseWindow& window, const TrackerPlan& plan);

/// Calibrator and bones during an exposure. A bone whose marker is not seen is absent; one that moved is
/// refused (pose_spread).
Expected<Poses> poses_of_exposure(const PoseWindow& window, const TrackerPlan& plan);

/// Where the pointer's tip is, in the frame of the bone's marker. Refuses as `see_tool`; bad_value without a
/// pointer.
Expected<Eigen::Vector3d> touched_in_bone(const PoseWindow& window, const TrackerPlan& plan, Bone bone);

/// Bones and tool; all must be seen.
Expected<Poses> poses_now(const PoseWindow& window, const TrackerPlan& plan);

}  // namespace helicarm
