// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/track/body_pose.h"
#include "helicarm/track/sequence.h"

namespace helicarm::track {

/// A pose (world_from_body) against the first frame's. The first one's error is in it, less what both share,
/// unless it is the first itself.
void against_first(TrackedBody& frame, const FramePose& pose, const Eigen::Vector3d& centre_in_body,
                   const FramePose& first, bool is_first);

/// The pose of a body against a reference, whose errors are independent, in the reference's first frame;
/// covariance about the body's centre there. The centres are those of the covariances.
FramePose relative_pose(const FramePose& reference, const Eigen::Vector3d& reference_centre,
                        const FramePose& body, const Eigen::Vector3d& centre);

/// Puts a body's poses of all frames and its smooth motion into its series, each against its first frame, by
/// its smooth pose if there is one: that pose is returned. `body.frames` has the decisions, reasons and
/// markers of the frames, and `body.smoothed` is as long; frames without a pose are refused, and warned of
/// where the motion fills them between others.
std::optional<FramePose> take_motion(BodySequence& body, const std::vector<std::optional<FramePose>>& poses,
                                     const std::optional<SmoothMotion>& motion,
                                     const Eigen::Vector3d& centre_in_body);

/// Smooth motion of the second and further bodies in the first one's coordinates, [body - 1][frame]. The
/// bodies' errors are taken as independent.
std::vector<std::vector<TrackedBody>> relative_motions(const std::vector<BodySequence>& bodies);

}  // namespace helicarm::track
