// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
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

/// Distortion by an image's own plate.
struct PlateMap {
  rectification::DistortionMap map;  ///< without covariance
  double field_radius_px = 0;        ///< distance of its dots from their middle, at most
};

/// Intrinsics estimated from one image's fiducials without the prior: focal length, and principal point from
/// the image's centre (u, v; as if not mirrored), mm on the detector.
struct HistoryEntry {
  std::string image;  ///< digest of the pixels
  std::string view;
  Eigen::Vector3d estimate_mm;
  Eigen::Matrix3d information;  ///< inverse covariance, 1 / mm^2
  std::optional<double> primary_deg = {},
                        secondary_deg = {};  ///< positioner angles, if the image states them
  std::string date = {};  ///< of the acquisition if it was told, else of adding it: 2026-11-26
  std::optional<PlateMap> plate = {};
};

/// The day of a date like 2026-11-26; nothing of any other text.
std::optional<std::chrono::sys_days> day_of(const std::string& date);

/// Where the central rays of a run of images meet.
struct RunIsocentre {
  std::string run;                                     ///< digest of the first image that it tells of
  std::string date = {};                               ///< as HistoryEntry's
  int images = 0;                                      ///< accepted
  double arc_deg = 0;                                  ///< between the first and the last
  double radius_mm = 0;                                ///< to the farthest central ray
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();  ///< of the isocentre, in the calibrator's frame
  double source_to_axis_mm = 0;
};

/// Differences from what the history predicts that are no change of the C-arm, mm.
struct CArmTolerances {
  double focal_mm = 0, principal_mm = 0;
};

/// A C-arm's history.
struct CArmHistory {
  std::vector<HistoryEntry> entries;
  CArmTolerances tolerances = {};
  std::vector<RunIsocentre> runs = {};
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

/// Whether both are of one image size and one field of the intensifier.
bool are_of_one_field(const rectification::DistortionMap& a, const rectification::DistortionMap& b);

/// Those whose maps count, in their order: of the latest one's field the latest few of each position, so that
/// daily images of two positions do not push out the others.
std::vector<std::size_t> entries_with_latest_maps(std::span<const HistoryEntry> entries);

/// Takes the maps away that no longer count in their own field: a record would grow by them for ever.
void forget_old_maps(CArmHistory& history);

/// Adds the entries of images that the history does not hold, and the map of an image that it holds without
/// one; returns how many entries.
std::size_t add_entries(CArmHistory& history, std::span<const HistoryEntry> entries);

/// machine.json (docs/formats.md).
Expected<CArmHistory> read_history(const std::filesystem::path& path);
/// Empty where there is no file.
Expected<CArmHistory> history_at(const std::filesystem::path& path);
Expected<CArmHistory> history_from_json(const Json& json, const std::string& origin);
Json to_json(const CArmHistory& history);

}  // namespace helicarm::calibration
