// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm::tracker {

struct ExposurePoseOptions {
  double window_s = 0.25;  ///< half width around the requested time: ten poses at 20 Hz
  double max_gap_s = 0.1;  ///< largest distance to the nearest pose before and after
  int min_samples = 3;
  double max_spread_mm = 0.5;  ///< rms about the mean: trackers have below 0.1 mm of jitter
  double max_spread_deg = 0.5;
};

struct ExposurePose {
  geometry::RigidTransform tracker_from_tool;
  /// of the mean, from the samples' scatter, assuming independent errors
  PoseCovariance covariance;
  int samples = 0;   ///< samples used
  int outliers = 0;  ///< samples rejected
  double spread_mm = 0;
  double spread_deg = 0;
};

/// The pose at `time_s` (this machine's monotonic clock): mean of the samples around it that lie near their
/// median. Refuses with figures: no sample (`no_pose`); none on one side, a gap, or too few (`stale_pose`: no
/// extrapolation); scatter above the limit or more than a quarter outliers (`pose_spread`).
Expected<ExposurePose> exposure_pose(std::span<const PoseSample> samples, double time_s,
                                     const ExposurePoseOptions& options = {});

}  // namespace helicarm::tracker
