// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "studies/engine.h"
#include "studies/study_files.h"

namespace helicarm::study {

struct CentreOptions {
  std::size_t groups = 1000;  ///< balls of each situation, rounded up to whole images
  std::uint64_t seed = 1;
  std::vector<std::string> only = {};  ///< groups of situations; empty: all
  int squares = 10;                    ///< across an image, one ball in each
};

/// Errors of ball centres in one situation; per axis, px.
struct CentreRow {
  std::string group;  ///< the varied quantity
  std::string situation;
  int balls = 0;
  int refused = 0;         ///< not found or not fitted; left out of the values below
  double rms_px = 0;       ///< of the error
  double bias_px = 0;      ///< mean error towards the neighbour, wire or bone, else the brighter side
  double sigma_px = 0;     ///< predicted, rms
  double z = 0;            ///< rms of error over predicted sigma
  double coverage = 0;     ///< share of balls whose 95 % ellipse contains the truth
  double radius_bias = 0;  ///< mean ratio of fitted to true radius, minus 1
  double bound_px = 0;     ///< Cramer-Rao, rms over some of the balls; not finite if not computed
  double ratio() const { return rms_px / bound_px; }
};

/// Fits the centres of simulated balls over a sloping, scattering background, with correct and wrong
/// assumptions. All situations share balls, positions and noise. The simulator traces rays through solids,
/// independently of the fit's model. Empty at ranks other than the leader.
Expected<std::vector<CentreRow>> study_centres(const CentreOptions& options, const EngineOptions& engine,
                                               const Ranks& ranks);

/// centres.csv, centres.json, centres.svg and one line for each situation.
StudyFiles files_of(const std::vector<CentreRow>& rows, const CentreOptions& options);

}  // namespace helicarm::study
