// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/core/field.h"
#include "studies/engine.h"
#include "studies/study_files.h"

namespace helicarm::study {

/// Table 1's columns of UDCSC and Fig. 14 from images: tests of 3.2 with simulated scenes (intensifier,
/// plate, knee, calibrator with five check targets), each measured by the published method and by the best
/// one. The errors of a real bench, which the paper does not state, are options.
struct CalibrationStudyOptions {
  std::size_t groups = 10;  ///< tests, each with an AP and a lateral image
  std::uint64_t seed = 1;
  int size_px = 1024;            ///< 512 or 1024
  std::filesystem::path folder;  ///< for the temporary cases
  /// Per axis, of each ball and check target as made against the design, to which TRE refers.
  double tolerance_mm = 0;
  double click_sigma_px = 0;  ///< per axis, of clicks on the check targets; 0: they are found by templates
};

inline constexpr std::array<Field<CalibrationStudyOptions>, 2> calibration_fields{
    helicarm::bound<&CalibrationStudyOptions::tolerance_mm>(
        {.name = "tolerance_mm",
         .flag = "--tolerance",
         .unit = "mm",
         .range = {0, 2},
         .help = "calibration: balls and targets as made against the design, per axis, mm"}),
    helicarm::bound<&CalibrationStudyOptions::click_sigma_px>(
        {.name = "click_sigma_px",
         .flag = "--click",
         .unit = "px",
         .range = {0, 20},
         .help = "calibration: error of clicks on the targets per axis, px; 0: found by the program"})};

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
