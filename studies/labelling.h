// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/simulation/synthetic_detections.h"

namespace helicarm::study {

/// Random views of a calibrator, each with occluded balls and outliers. Each view can be replayed alone.
struct LabellingStudy {
  int views = 10000;
  std::uint64_t seed = 1;
  unsigned threads = 0;  ///< 0: all cores
  int most_hidden = 6;
  int most_false = 10;
  simulation::OutlierKind outliers = simulation::OutlierKind::uniform;
  double noise_px = 0.5;  ///< of centres, per axis
};

/// Measured: of views with at least eight balls, the unsolved share is 1/3 within 20 degrees, 1/10 from 20 to
/// 25, 1/90 from 25 to 30, 1/400 from 30 to 35 and 1/2200 beyond.
constexpr double spread_deg = 35;

struct LabellingCount {
  int views = 0;
  int solved = 0;    ///< accepted, with all labels and the mirroring correct
  int imitated = 0;  ///< of these: an outlier imitates an occluded ball within the noise
  int wrong = 0;     ///< accepted, but not correct
  std::map<Reason, int> refused;
};

struct LabellingTally {
  LabellingCount all;
  std::vector<LabellingCount> by_visible;  ///< index: number of separately visible balls
  /// Views with at least eight balls. Spread: the ray to the balls' centre is at least `spread_deg` off the
  /// cone's axis, so that the helix's pitch is visible. Along the axis all labels may be shifted by one: a
  /// quarter turn with the cone 5 % wider.
  LabellingCount spread;
  LabellingCount not_spread;
  double median_ms = 0;  ///< CPU time per view; the only values that differ between runs
  double p99_ms = 0;
};

/// The counts do not depend on the number of threads.
LabellingTally study_labelling(const phantom::Calibrator& calibrator, const LabellingStudy& study);

}  // namespace helicarm::study
