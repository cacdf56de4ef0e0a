// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/registration/motion.h"

namespace helicarm::track {

/// A pose of one frame with its covariance about the body's centre (rotation vector in rad, then mm, in world
/// axes).
struct FramePose {
  geometry::RigidTransform pose;
  registration::RigidCovariance covariance = registration::RigidCovariance::Zero();
  /// What one error that all frames share, of one standard deviation, moves the pose by; not in `covariance`.
  registration::RigidStep common = registration::RigidStep::Zero();
};

/// Power of the white jerk: rad^2 and mm^2 per frame^5.
struct MotionPrior {
  double turn = 1e-8;
  double shift = 1e-2;
};

struct SmoothMotion {
  std::vector<FramePose> frames;
  MotionPrior prior;
  double noise_factor = 1, turn_noise_factor = 1;  ///< of the measured places' and turns' standard deviations
};

/// Measured covariances as they are stated, or with standard deviations multiplied by one factor for places
/// and one for turns, which then have the largest likelihood with the prior (1 for fewer than ten measured
/// frames). A factor below 1 leaves a rest: errors that neighbouring frames share, which stay in the result's
/// covariance.
enum class NoiseScale { stated, by_data };

/// One estimate over all frames: rotation and the centre's place with white jerk, whose size has the largest
/// likelihood; frames without a pose get the width that the prior gives them. Extended Kalman filter and
/// Rauch-Tung-Striebel smoother on SO(3) x R^3. `times`: of each frame, increasing. Nothing for fewer than
/// three measured frames.
std::optional<SmoothMotion> smooth_poses(std::span<const double> times,
                                         std::span<const std::optional<FramePose>> measured,
                                         const Eigen::Vector3d& centre_in_body,
                                         NoiseScale scale = NoiseScale::stated);

/// A place with its covariance.
struct FramePlace {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

/// Likewise for a point.
std::optional<std::vector<FramePlace>> smooth_places(std::span<const double> times,
                                                     std::span<const std::optional<FramePlace>> measured);

}  // namespace helicarm::track
