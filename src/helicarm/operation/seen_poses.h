// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <stop_token>
#include <string>
#include <vector>

#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/operation/plan.h"

namespace helicarm::operation {

/// Samples of every marker about one time (monotonic seconds).
struct PoseWindow {
  double middle_s = 0;
  double half_s = 0;
  std::map<std::string, std::vector<tracker::PoseSample>> samples;
};

Json to_json(const PoseWindow& window);
/// Exact to the last bit. Fails as JsonReader.
Expected<PoseWindow> pose_window_from(const Json& json, const std::string& origin);

/// The 1.5 s before an image's arrival, which contain the acquisition; longer by the resolution of the
/// acquisition time, which limits the estimate of its delay.
PoseWindow window_of_exposure(const tracker::PoseBoard& board, const TrackerPlan& plan, double arrival_s,
                              double coarse_s = 0);
/// The next 0.75 s; waits until they are over. Throws BadInput (interrupted) on a stop request.
PoseWindow window_now(const tracker::PoseBoard& board, const TrackerPlan& plan, const std::stop_token& end);

/// A marker at rest over a window.
struct SeenPose {
  geometry::RigidTransform tracker_from_marker;
  tracker::PoseCovariance scatter;  ///< of the mean, from the samples
  tracker::PoseCovariance
      covariance;  ///< scatter plus the error that averaging does not reduce (sigmas of TrackerPlan)
};

/// Refuses as `exposure_pose`: not visible, visible only in part of the window, moved.
Expected<SeenPose> see_tool(const PoseWindow& window, const TrackerPlan& plan, const std::string& tool);

/// Whether a marker was seen until the window's end, but for the gap that `see_tool` allows.
bool is_seen_at_end(const PoseWindow& window, const std::string& marker);

/// From the visible facets. Refuses as `fuse_facets`, and if a facet moved.
Expected<SeenPose> see_calibrator(const PoseWindow& window, const TrackerPlan& plan);

/// Calibrator and bones during an acquisition. A bone whose marker is not visible is absent; one that moved
/// is refused (pose_spread).
Expected<guidance::Poses> poses_of_exposure(const PoseWindow& window, const TrackerPlan& plan);

/// Position of the pointer's tip in the frame of the bone's marker. Refuses as `see_tool`; bad_value without
/// a pointer.
Expected<Eigen::Vector3d> touched_in_bone(const PoseWindow& window, const TrackerPlan& plan,
                                          const guidance::Bone& bone);

/// Bones and tool; all must be visible.
Expected<guidance::Poses> poses_now(const PoseWindow& window, const TrackerPlan& plan);

}  // namespace helicarm::operation
