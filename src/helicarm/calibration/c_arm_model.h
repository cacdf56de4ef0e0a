// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "helicarm/calibration/c_arm_history.h"

namespace helicarm::calibration {

/// Variation of one kind of intrinsics over the acquisitions of a C-arm, mm.
struct CArmVariation {
  double smooth = 0;  ///< sag: a function of the position, correlated over 40 degrees
  double repeat = 0;  ///< from one acquisition to the next in one position
};

/// Intrinsics of a C-arm as a Gaussian process over its position (Rasmussen and Williams 2006, 2.2, 5.4.1).
struct CArmModel {
  /// Focal length and principal point, as HistoryEntry::estimate_mm, of entries that do not know their own.
  Eigen::Vector3d nominal_mm;
  CArmPrior unknown;                    ///< before any acquisition
  std::vector<HistoryEntry> entries;    ///< the latest 150 of the history
  CArmVariation focal, principal;       ///< of greatest posterior density
  std::vector<RunIsocentre> runs = {};  ///< of the history
};

/// Fits both variations to the history's latest entries. With few entries they stay near those of an unknown
/// C-arm.
CArmModel c_arm_model(std::span<const HistoryEntry> entries, const Eigen::Vector3d& nominal_mm,
                      const CArmPrior& unknown);

/// Change of the intrinsics with time, mm a year, and its standard deviation.
struct CArmDrift {
  Eigen::Vector3d mm_a_year, sigma;
};

/// By generalised least squares over the acquisitions that have a date, beside sag and repeatability; nothing
/// where all of them were added on one day.
std::optional<CArmDrift> c_arm_drift(const CArmModel& model);

/// Joint prediction of acquisitions: three values each, in the entries' order, without their own errors.
struct IntrinsicsPrediction {
  Eigen::VectorXd mean_mm;         ///< 3n
  Eigen::MatrixXd covariance_mm2;  ///< 3n x 3n
};

/// Of acquisitions at the positions of `at`, of which only the angles are used. An acquisition whose image
/// does not state its angles is like one in a position of its own.
IntrinsicsPrediction predict_intrinsics(const CArmModel& model, std::span<const HistoryEntry> at);

/// A new acquisition beside the history's prediction.
struct AcquisitionCheck {
  HistoryEntry entry;
  Eigen::Vector3d predicted_mm;
  Eigen::Vector3d sigma_mm;  ///< of the difference entry - prediction
  double chi2 = 0;           ///< of the difference, 3 degrees of freedom
  /// Where all together are significant: beyond the tolerances, and significant alone or the most so.
  bool is_changed = false;
};

/// A new acquisition's distortion beside that of the history, root mean square per axis over the field, px.
struct MapDifference {
  std::string view;
  double error_px = 0, sigma_px = 0;
  bool is_changed = false;
};

/// New acquisitions of one case beside a history that does not hold them.
struct CArmCheck {
  std::vector<AcquisitionCheck> acquisitions;
  double chi2 = 0;                  ///< of all together
  double limit = 0;                 ///< its 99.9 % quantile
  bool changed = false;             ///< significant, and beyond the history's tolerances in one acquisition
  std::vector<MapDifference> maps;  ///< of the acquisitions with a map, beside those of the history
  /// Views whose maps are not compared: of another field than those of the history, or these are too few.
  std::vector<std::string> uncompared_maps;
  std::size_t recorded_maps = 0;  ///< that count
};

/// Fewer recorded maps do not tell what is usual of a C-arm.
inline constexpr std::size_t least_compared_maps = 4;

CArmCheck check_c_arm(const CArmModel& model, std::span<const HistoryEntry> acquired,
                      const CArmTolerances& tolerances);

/// Each entry of the model beside the prediction by all others.
std::vector<AcquisitionCheck> leave_one_out(const CArmModel& model);

}  // namespace helicarm::calibration
