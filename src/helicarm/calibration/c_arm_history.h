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

/// Columns of HistoryEntry::by_calibrator: 100 balls. The errors of more are taken as three, of the estimate
/// itself.
inline constexpr std::size_t most_ball_errors = 300;

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
  std::optional<double> nominal_focal_mm = {};  ///< source distance that the image or its case stated
  std::string calibrator = {};                  ///< `CommonPrior::calibrator`; empty: exact
  /// mm: the estimate's error by unit errors of the calibrator's coordinates, which are the same in all of
  /// its images; a part of the covariance. No columns: none.
  Eigen::Matrix3Xd by_calibrator = {};

  /// Of the estimate, from the values that the image stated; of an entry that does not know them, from
  /// `nominal_mm`.
  Eigen::Vector3d deviation_from(const Eigen::Vector3d& nominal_mm) const {
    return estimate_mm - stated_or(nominal_mm);
  }
  Eigen::Vector3d stated_or(const Eigen::Vector3d& nominal_mm) const {
    return nominal_focal_mm ? Eigen::Vector3d(*nominal_focal_mm, 0, 0) : nominal_mm;
  }
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

/// Mean deviation of a C-arm's views from what each of them states, mm, and the variation about it.
struct LearnedDeviation {
  Eigen::Vector3d mm = Eigen::Vector3d::Zero();
  CArmPrior prior = {};
};

/// Prior of the next views from a history.
struct LearnedIntrinsics {
  Eigen::Vector3d nominal_mm;  ///< as the first view states
  LearnedDeviation deviation;
  /// Of views of a calibrator that the history knows: for coordinates as in its file; their errors, which
  /// these views share with the history, move it (`CArmPrior::by_ball_errors`). Else as `deviation`.
  LearnedDeviation of_calibrator;

  Eigen::Vector3d mean_mm() const { return nominal_mm + deviation.mm; }
};

/// Estimates the mean deviation and the sag about it by expectation maximisation from the prior `unknown`
/// about the nominal values, `nominal_mm` where an entry does not know its own. The prior of the sag's
/// variance has the weight of four acquisitions (Gelman et al., Bayesian Data Analysis, 2013, 5.4). Errors of
/// a calibrator's coordinates are common to its entries. `calibrator`: of the next views.
LearnedIntrinsics learn_intrinsics(std::span<const HistoryEntry> entries, const Eigen::Vector3d& nominal_mm,
                                   const CArmPrior& unknown, const std::string& calibrator = {});

/// The entry of one view: calibrated alone, with the prior's information subtracted. Nothing if the view
/// cannot be calibrated, or if pixel size or source distance are unknown.
std::optional<HistoryEntry> history_entry_of(const ViewFiducials& view, const std::string& image,
                                             const CommonPrior& unknown);

/// `prior` with its nominal values moved by the history's mean deviation.
geometry::IntrinsicsPrior learned_prior(geometry::IntrinsicsPrior prior, const Eigen::Vector3d& deviation_mm,
                                        bool mirrored);

/// Whether both are of one image size and one field of the intensifier.
bool are_of_one_field(const rectification::DistortionMap& a, const rectification::DistortionMap& b);

/// Those whose maps count, in their order: of the latest one's field the latest few of each position, so that
/// daily images of two positions do not push out the others.
std::vector<std::size_t> entries_with_latest_maps(std::span<const HistoryEntry> entries);

/// Takes the maps away that no longer count in their own field: a record would grow by them for ever.
void forget_old_maps(CArmHistory& history);

/// Adds the entries of images that the history does not hold, and to those that it holds what they lack;
/// returns how many entries.
std::size_t add_entries(CArmHistory& history, std::span<const HistoryEntry> entries);

/// machine.json (docs/formats.md).
Expected<CArmHistory> read_history(const std::filesystem::path& path);
/// Empty where there is no file.
Expected<CArmHistory> history_at(const std::filesystem::path& path);
Expected<CArmHistory> history_from_json(const Json& json, const std::string& origin);
Json to_json(const CArmHistory& history);

}  // namespace helicarm::calibration
