// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "studies/engine.h"
#include "studies/study_files.h"

namespace helicarm::study {

struct LimitOptions {
  std::size_t groups = 1000;  ///< trials of each setting
  std::uint64_t seed = 1;
  std::vector<int> balls = {8, 12, 20};  ///< some of these
};

/// One setting of the experiment: balls, noise, knowledge of the intrinsics, position of the point.
struct LimitRow {
  int balls;
  double sigma_px;    ///< of ball centres, per axis
  std::string model;  ///< free (11 parameters), square (f, u0, v0), prior, machine, known
  std::string place;
  bool point_exact;  ///< else its pixels have the noise of the balls
  int trials = 0;
  int failures = 0;     ///< refused or not located; left out of the values below
  double bound_mm = 0;  ///< Cramer-Rao, rms
  double error_mm = 0;  ///< rms
  double dlt_mm = 0;    ///< rms of Eq. 7 and Eq. 8 on the same pixels
  double coverage = 0;  ///< share of trials whose 95 % ellipsoid contains the truth
  double efficiency() const { return error_mm / bound_mm; }
};

/// The estimators compared with the statistical bound, in the geometry of 2.3.3 (f 900 mm, 0.15 mm pixels, AP
/// and lateral at 800 mm). Empty at ranks other than the leader.
Expected<std::vector<LimitRow>> study_limit(const LimitOptions& options, const EngineOptions& engine,
                                            const Ranks& ranks);

/// limit.csv, limit.json, limit.svg (12 balls, exact pixels) and one line for each model.
StudyFiles files_of(const std::vector<LimitRow>& rows, const LimitOptions& options);

}  // namespace helicarm::study
