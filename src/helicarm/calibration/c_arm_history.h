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
#include "helicarm/rectification/distortion_map.h"

namespace helicarm::calibration {

/// Intrinsics estimated from one image's fiducials without the prior: focal length, and principal point from
/// the image's centre (u, v; as if not mirrored), mm on the detector.
struct HistoryEntry {
  std::string image;  ///< digest of the pixels
  std::string view;
  Eigen::Vector3d estimate_mm;
  Eigen::Matrix3d information;  ///< inverse covariance, 1 / mm^2
  std::optional<double> primary_deg = {},
                        secondary_deg = {};              ///< positioner angles, if the image states them
  std::string date = {};                                 ///< UTC, on which it was added: 2026-11-26
  std::optional<rectification::DistortionMap> map = {};  ///< by the image's own plate; without covariance
  double field_radius_px = 0;  ///< of a map: distance of its dots from their middle, at most
};

/// Differences from what the history predicts that are no change of the C-arm, mm.
struct CArmTolerances {
  double focal_mm = 0, principal_mm = 0;
};

/// A C-arm's history.
struct CArmHistory {
  std::vector<HistoryEntry> entries;
  CArmTolerances tolerances = {};
};

/// Prior of the next views from a history: mean, and variation about it.
struct LearnedIntrinsics {
  Eigen::Vector3d mean_mm;
  CArmPrior prior;
};

/// Estimates the mean and the sag about it by expectation maximisation from the prior `unknown` about
/// `nominal_mm`. The prior of the sag's variance has the weight of four acquisitions (Gelman et al., Bayesian
/// Data Analysis, 2013, 5.4).
LearnedIntrinsics learn_intrinsics(std::span<const HistoryEntry> entries, const Eigen::Vector3d& nominal_mm,
                                   const CArmPrior& unknown);

/// The entry of one view: calibrated alone, with the prior's information subtracted. Nothing if the view
/// cannot be calibrated, or if pixel size or source distance are unknown.
std::optional<HistoryEntry> history_entry_of(const ViewFiducials& view, const std::string& image,
                                             const CommonPrior& unknown);

/// `prior` with the history's mean in place of the nominal values.
geometry::IntrinsicsPrior learned_prior(geometry::IntrinsicsPrior prior, const LearnedIntrinsics& knowledge,
                                        bool mirrored);

/// Adds the entries of images that the history does not hold; returns how many.
std::size_t add_entries(CArmHistory& history, std::span<const HistoryEntry> entries);

/// machine.json (docs/formats.md).
Expected<CArmHistory> read_history(const std::filesystem::path& path);
/// Empty where there is no file.
Expected<CArmHistory> history_at(const std::filesystem::path& path);
Expected<CArmHistory> history_from_json(const Json& json, const std::string& origin);
Json to_json(const CArmHistory& history);

}  // namespace helicarm::calibration
