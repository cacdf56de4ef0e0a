// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/core/json.h"

namespace helicarm {

/// What the balls of one image told of its C-arm, apart from all that was believed before: focal length and
/// principal point from the image's centre (u, v; as if not mirrored), mm on the receiver.
struct HistoryEntry {
  std::string image;  ///< digest of the pixels
  std::string view;
  Eigen::Vector3d estimate_mm;
  Eigen::Matrix3d information;  ///< inverse covariance, 1 / mm^2
};

/// A C-arm's history.
struct CArmHistory {
  std::vector<HistoryEntry> entries;
};

/// What a history tells of the next views: they depart from `mean_mm` as `prior` says.
struct LearnedIntrinsics {
  Eigen::Vector3d mean_mm;
  CArmPrior prior;
};

/// Shots scatter about a mean by sag: both are found together by expectation maximisation, starting from what
/// is believed of an unknown machine about `nominal_mm`. The sag's variance is believed as if from
/// four earlier acquisitions (Gelman et al., Bayesian Data Analysis, 2013, 5.4).
LearnedIntrinsics learn_intrinsics(std::span<const HistoryEntry> entries, const Eigen::Vector3d& nominal_mm,
                                   const CArmPrior& unknown);

/// The lesson of one view's balls: its calibration alone, less what was believed beforehand. Nothing where
/// the view cannot be calibrated or its scale is not known.
std::optional<HistoryEntry> history_entry_of(const ViewFiducials& view, const std::string& image,
                                             const CommonPrior& unknown);

/// `prior` with the mean of what is known of the machine in place of the nominal values.
IntrinsicsPrior learned_prior(IntrinsicsPrior prior, const LearnedIntrinsics& knowledge, bool mirrored);

/// machine.json (docs/formats.md).
Expected<CArmHistory> read_history(const std::filesystem::path& path);
Expected<CArmHistory> history_from_json(const Json& json, const std::string& origin);
Json to_json(const CArmHistory& history);

}  // namespace helicarm
