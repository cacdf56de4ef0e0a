// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/study/engine.h"
#include "helicarm/study/study_files.h"

namespace helicarm::study {

/// Table 1's columns of UDCSC and Fig. 14 from images: tests of 3.2 with simulated scenes (intensifier,
/// plate, knee, calibrator with five check targets), each measured by the published method and by the best
/// one.
struct CalibrationStudyOptions {
  std::size_t groups = 10;  ///< tests, each with an AP and a lateral image
  std::uint64_t seed = 1;
  int size_px = 1024;            ///< 512 or 1024
  std::filesystem::path folder;  ///< for the temporary cases
};

/// One test by one method, mm; NaN for what was refused or not located.
struct CalibrationTest {
  double refused = 1;  ///< 1: refused
  double balls = 0;    ///< number of fiducials in FRE
  double fre_mean, fre_max, fre_min, fre_rms;
  std::array<double, 5> targets;  ///< T1, in the centre, to T5
};

struct CalibrationTests {
  std::uint32_t case_seed;  ///< `helicarm simulate --seed` gives the same case
  CalibrationTest paper, best;
};

/// Empty at ranks other than the leader.
Expected<std::vector<CalibrationTests>> study_calibration(const CalibrationStudyOptions& options,
                                                          const EngineOptions& engine, const Ranks& ranks);

/// calibration.csv, calibration.json, calibration.svg and the comparison with the paper.
StudyFiles files_of(const std::vector<CalibrationTests>& tests, const CalibrationStudyOptions& options);

}  // namespace helicarm::study
