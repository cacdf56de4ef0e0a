// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/study/engine.h"
#include "helicarm/study/study_files.h"

namespace helicarm {

/// Table 1's columns of UDCSC and Fig. 14 from images: tests of 3.2 in the virtual operating room
/// (intensifier, plate, knee, calibrator with its five check targets), each measured by the printed recipe
/// and by the best one.
struct CalibrationStudyOptions {
  std::size_t groups = 10;  ///< tests: an AP and a lateral exposure each
  std::uint64_t seed = 1;
  int size_px = 1024;            ///< 512 or 1024
  std::filesystem::path folder;  ///< for the cases while they are measured
};

/// One test by one method; NaN for what was refused or not located, mm.
struct CalibrationTest {
  double refused = 1;  ///< 1: no answer
  double balls = 0;    ///< that FRE is of
  double fre_mean, fre_max, fre_min, fre_rms;
  std::array<double, 5> targets;  ///< T1, in the middle, to T5
};

struct CalibrationTests {
  std::uint32_t case_seed;  ///< `helicarm simulate --seed` draws the same case
  CalibrationTest paper, best;
};

/// Empty at ranks that do not lead.
Expected<std::vector<CalibrationTests>> study_calibration(const CalibrationStudyOptions& options,
                                                          const EngineOptions& engine, const Ranks& ranks);

/// calibration.csv, calibration.json, calibration.svg and how it compares with the print.
StudyFiles files_of(const std::vector<CalibrationTests>& tests, const CalibrationStudyOptions& options);

}  // namespace helicarm
