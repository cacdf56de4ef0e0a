// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/simulation/synthetic_detections.h"

namespace helicarm {

/// Random views of a calibrator, each with balls hidden and false discs added. Any view can be replayed
/// alone.
struct LabellingStudy {
  int views = 10000;
  std::uint64_t seed = 1;
  unsigned threads = 0;  ///< 0: all cores
  int most_hidden = 6;
  int most_false = 10;
  simulation::OutlierKind outliers = simulation::OutlierKind::uniform;
  double noise_px = 0.5;  ///< of centres, per axis
};

/// Measured: of views with eight balls or more, one of three is not solved within 20 degrees, one of ten from
/// there to 25, one of 90 to 30, one of 400 to 35 and one of 2200 beyond.
constexpr double spread_deg = 35;

struct LabellingCount {
  int views = 0;
  int solved = 0;    ///< accepted, and every name and the mirroring are right
  int imitated = 0;  ///< of these: a false disc passes for a hidden ball, within the noise
  int wrong = 0;     ///< accepted, but not right
  std::map<Reason, int> refused;
};

struct LabellingTally {
  LabellingCount all;
  std::vector<LabellingCount> by_visible;  ///< index: balls that show a disc of their own
  /// Of the views with eight balls or more. Spread: the ray to the balls' middle is at least `spread_deg` off
  /// the cone's axis, so that the rise of the helix shows. Along the axis, the balls' names may all be
  /// shifted by one: a quarter turn, the cone a twentieth wider.
  LabellingCount spread;
  LabellingCount not_spread;
  double median_ms = 0;  ///< of CPU time, by view: the only figures that another run does not repeat
  double p99_ms = 0;
};

/// The same counts whatever the number of threads.
LabellingTally study_labelling(const Calibrator& calibrator, const LabellingStudy& study);

}  // namespace helicarm
