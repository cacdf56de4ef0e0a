// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <limits>
#include <span>

#include <Eigen/Core>

#include "studies/limit.h"

namespace helicarm::study {

/// Knowledge of the intrinsics.
enum class LimitModel { free, square, prior, c_arm, known };
inline constexpr std::array limit_models{LimitModel::free, LimitModel::square, LimitModel::prior,
                                         LimitModel::c_arm, LimitModel::known};

/// Positions of the points, each with noisy and with exact pixels.
struct LimitPlace {
  const char* name;
  Eigen::Vector3d off_centre_mm;
};
inline const std::array<LimitPlace, 4> limit_places{{{"centre", {0, 0, 0}},
                                                     {"50 mm lateral", {50, 0, 0}},
                                                     {"100 mm lateral", {100, 0, 0}},
                                                     {"150 mm axial", {0, 0, 150}}}};
inline constexpr std::size_t rows_of_limit_setting = 8;

struct LimitSetting {
  int balls;
  double sigma_px;
  LimitModel model;
  std::uint32_t stream;
};

/// Result of a trial for one place; NaN without an answer or bound.
struct LimitOutcome {
  double located = 0, covered = 0, error2 = 0;
  double dlt2 = std::numeric_limits<double>::quiet_NaN(), bound2 = dlt2;
};
using LimitOutcomes = std::array<LimitOutcome, rows_of_limit_setting>;

/// Trials of one block share a C-arm if the model has one.
inline constexpr std::size_t limit_trials_of_block = 50;

/// The results of a block's trials as records; the last block may have fewer.
void run_limit_trials(const LimitSetting& setting, const LimitOptions& options, std::size_t block,
                      std::span<double> out);

}  // namespace helicarm::study
