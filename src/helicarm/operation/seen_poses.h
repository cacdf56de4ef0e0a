// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/operation/plan.h"

namespace helicarm {

/// A marker's pose over a short while, and how exactly it is known: its scatter and what the tracker is known
/// to keep (TrackerPlan's sigmas).
struct SeenPose {
  RigidTransform tracker_from_marker;
  PoseCovariance covariance;
};

/// The pose of a tool while it was at rest about `time_s` (monotonic). Refuses as `exposure_pose`.
Expected<SeenPose> see_tool(const PoseBoard& board, const TrackerPlan& plan, const std::string& tool,
                            double time_s, const ExposurePoseOptions& options = {});

/// The calibrator's, from whichever facets are seen. Refuses as `fuse_facets`.
Expected<SeenPose> see_calibrator(const PoseBoard& board, const TrackerPlan& plan, double time_s,
                                  const ExposurePoseOptions& options = {});

/// Calibrator and bones at an exposure whose picture came at `arrival_s`: the shot lies somewhere in the
/// second and a half before, so everything must have been at rest all that while. A bone whose marker is not
/// seen is absent; the calibrator must be seen. Refuses also (pose_spread) where something moved.
Expected<Poses> poses_of_exposure(const PoseBoard& board, const TrackerPlan& plan, double arrival_s);

/// Bones and tool as they are now; all must be seen.
Expected<Poses> poses_now(const PoseBoard& board, const TrackerPlan& plan);

/// What a case is told of the tracker.
TrackerNoise noise_of(const TrackerPlan& plan);

}  // namespace helicarm
