// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/study/engine.h"
#include "helicarm/study/study_files.h"

namespace helicarm {

struct CentreOptions {
  std::size_t groups = 1000;  ///< balls of each situation, filled up to whole images
  std::uint64_t seed = 1;
  std::vector<std::string> only = {};  ///< groups of situations; empty: all
  int squares = 10;                    ///< across an image, a ball in each
};

/// How far off the centres of balls are in one situation; errors per axis, pixels.
struct CentreRow {
  std::string group;  ///< what is varied
  std::string situation;
  int balls = 0;
  int refused = 0;    ///< not found or not fitted; left out of what follows
  double rms_px = 0;  ///< of the error
  double bias_px =
      0;  ///< mean error towards what disturbs: the neighbour, wire or bone, else the brighter side
  double sigma_px = 0;     ///< predicted, rms
  double z = 0;            ///< rms of error over its own sigma
  double coverage = 0;     ///< share of balls whose 95 % ellipse holds the truth
  double radius_bias = 0;  ///< mean fitted radius over the true one, less 1
  double bound_px = 0;     ///< Cramer-Rao, rms over some of the balls; not finite where it is not computed
  double ratio() const { return rms_px / bound_px; }
};

/// Fits the centres of balls that the simulator has drawn over a sloping, scattering background, with right
/// and wrong assumptions. All situations have the same balls, places and noise. The simulator traces rays
/// through solids and knows nothing of the fit's model. Empty at ranks that do not lead.
Expected<std::vector<CentreRow>> study_centres(const CentreOptions& options, const EngineOptions& engine,
                                               const Ranks& ranks);

/// centres.csv, centres.json, centres.svg and one line for each situation.
StudyFiles files_of(const std::vector<CentreRow>& rows, const CentreOptions& options);

}  // namespace helicarm
