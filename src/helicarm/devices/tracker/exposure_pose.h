// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm {

struct ExposurePoseOptions {
  double window_s = 0.25;  ///< half width about the time asked for: ten poses at 20 Hz
  double max_gap_s = 0.1;  ///< the nearest poses before and after must be no further off
  int min_samples = 3;
  double max_spread_mm = 0.5;  ///< rms about the mean: trackers jitter by less than 0.1 mm
  double max_spread_deg = 0.5;
};

struct ExposurePose {
  RigidTransform tracker_from_tool;
  /// Of the mean, from the samples' scatter, as if their errors were independent.
  PoseCovariance covariance;
  int samples = 0;   ///< that serve
  int outliers = 0;  ///< that were thrown out
  double spread_mm = 0;
  double spread_deg = 0;
};

/// The pose at `time_s` (this machine's monotonic clock) as the mean of the samples about it that lie near
/// their median. Refuses with figures: no sample at all (`no_pose`); none on one side, a gap, or too few
/// (`stale_pose`: nothing is extrapolated); scatter over the limit or over a quarter outliers
/// (`pose_spread`).
Expected<ExposurePose> exposure_pose(std::span<const PoseSample> samples, double time_s,
                                     const ExposurePoseOptions& options = {});

}  // namespace helicarm
