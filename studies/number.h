// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "helicarm/core/failure.h"
#include "studies/engine.h"
#include "studies/paper_scene.h"
#include "studies/statistics.h"
#include "studies/study_files.h"

namespace helicarm::study {

/// Pixels that are back-projected for FRE and TRE: those of the calibration (balls only), new ones with
/// independent noise, or exact ones.
enum class PixelReading { calibration_pixels, fresh_noise, exact };
inline constexpr std::array pixel_readings{PixelReading::calibration_pixels, PixelReading::fresh_noise,
                                           PixelReading::exact};
std::string_view name_of(PixelReading reading);

/// Values of one group: mean (Eq. 11) and largest error of its balls, mean error (Eq. 12) of targets in the
/// sphere of 100 mm about the origin and in the cone, error of a target at the cone's centre.
enum class GroupError { fre, fre_max, tre_ball, tre_cone, tre_centre };
inline constexpr std::array group_errors{GroupError::fre, GroupError::fre_max, GroupError::tre_ball,
                                         GroupError::tre_cone, GroupError::tre_centre};
std::string_view name_of(GroupError error);

/// Fig. 5: FRE and TRE over the number of balls.
struct NumberOptions {
  std::size_t groups = 10000;  ///< for each number of balls, drawn independently
  std::uint64_t seed = 1;
  std::vector<int> balls{6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18, 19, 20};  ///< 6 to 64 each
  std::vector<SigmaReading> sigmas{sigma_readings.begin(), sigma_readings.end()};
  std::vector<PixelReading> readings{pixel_readings.begin(), pixel_readings.end()};
  double fle = printed_fle;  ///< px or px^2, by the reading of sigma
  WorldOrigin origin = WorldOrigin::base;
};

struct NumberRow {
  int balls;
  SigmaReading sigma;
  PixelReading reading;
  GroupError error;
  ColumnStatistics of_groups;  ///< mm
};

/// One row for each number, sigma, reading and error, in this order; empty at ranks other than the leader.
Expected<std::vector<NumberRow>> study_number(const NumberOptions& options, const EngineOptions& engine,
                                              const Ranks& ranks);

/// number.csv, number.json, number.svg and the comparison with the paper.
StudyFiles files_of(const std::vector<NumberRow>& rows, const NumberOptions& options);

}  // namespace helicarm::study
