// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm::tracker {

/// Poses by robot and tracker at one moment, the robot at rest.
struct HandEyePair {
  geometry::RigidTransform base_from_flange;
  geometry::RigidTransform tracker_from_marker;
};

struct HandEyeOptions {
  /// The tracker's noise per axis about the marker's origin; both 0: estimated from the residuals. The robot
  /// is taken as exact.
  double sigma_mm = 0;
  double sigma_deg = 0;
  double min_turn_deg = 10;  ///< rms rotation about the second principal axis of the rotations
  double max_rms_mm = 2;  ///< uncalibrated arms deviate by millimetres; more indicates wrongly paired poses
  double max_rms_deg = 1;
};

struct HandEye {
  geometry::RigidTransform flange_from_marker;  ///< X of AX = XB
  geometry::RigidTransform tracker_from_base;
  /// Of flange_from_marker (along the flange's axes), then tracker_from_base (along the tracker's axes), each
  /// as PoseCovariance.
  Eigen::Matrix<double, 12, 12> covariance;
  double rms_mm = 0;   ///< of the marker's position
  double rms_deg = 0;  ///< of its rotation
  double turn_deg = 0;
};

/// Marker pose on the robot and robot pose in the tracker, from paired poses: initial values by the relative
/// motions (Park and Martin 1994), then Gauss-Newton on tracker_from_base base_from_flange flange_from_marker
/// = tracker_from_marker. Refuses with figures: fewer than three pairs, or rotations about parallel axes
/// (`poses_too_alike`); `residual_too_large`.
Expected<HandEye> calibrate_hand_eye(std::span<const HandEyePair> pairs, const HandEyeOptions& options = {});

}  // namespace helicarm::tracker
