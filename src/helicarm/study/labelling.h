// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/simulation/discs.h"

namespace helicarm {

/// Random views of a calibrator, each with balls hidden and false discs added. Any view can be replayed
/// alone.
struct LabellingStudy {
  int views = 10000;
  std::uint64_t seed = 1;
  unsigned threads = 0;  ///< 0: all cores
  int most_hidden = 6;
  int most_false = 10;
  simulation::FalseDiscs false_discs = simulation::FalseDiscs::strewn;
  double noise_px = 0.5;  ///< of centres, per axis
};

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
  /// Of the views with eight balls or more. Spread: without noise and false discs, every other naming of the
  /// visible balls is behind by log odds of 35. Noise of variance twice the mean leaves the 9.2 that the
  /// labelling asks for in all but one view of 1000.
  LabellingCount spread;
  LabellingCount not_spread;
  double median_ms = 0;  ///< of CPU time, by view: the only figures that another run does not repeat
  double p99_ms = 0;
};

/// The same counts whatever the number of threads.
LabellingTally study_labelling(const Calibrator& calibrator, const LabellingStudy& study);

}  // namespace helicarm
