// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/pivot_calibration.h"

namespace helicarm::tracker {

/// A place of the calibrator that a pointer can touch: a divot, or the surface of a ball.
struct MountPlace {
  Eigen::Vector3d centre_in_calibrator;  ///< mm
  double radius_mm = 0;  ///< of the ball and of the pointer's tip together; 0: the point itself
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of the centre, mm^2
};

/// A touched or pivoted place in the frame of the calibrator's marker (facet).
struct MountObservation {
  std::string label;
  Eigen::Vector3d point_in_facet;  ///< mm
  Eigen::Matrix3d covariance;      ///< mm^2, without the errors that all observations share
  /// d point / d tip_in_pointer; zero if no pointer was used.
  Eigen::Matrix3d by_tip = Eigen::Matrix3d::Zero();
  /// Unit, from the tip to the pointer's marker: the side of a ball on which the tip lies. Zero without
  /// pointer.
  Eigen::Vector3d side = Eigen::Vector3d::Zero();
};

struct MountOptions {
  double sigma_mm = 0.12;  ///< error of a reading that averaging does not reduce, per axis
  double sigma_deg = 0.05;
  double seat_mm = 0.1;  ///< of the tip in a divot or on a ball, per axis
  /// Of the tip in its pointer, common to all touches, mm^2; from `calibrate_pivot`. Zero: an exact tip.
  /// Nothing: its error is not known, and the touches alone determine the tip.
  std::optional<Eigen::Matrix3d> tip_covariance = {};
  double max_tre_mm = 1;  ///< largest predicted error at a place of the calibrator
};

/// A touch with the pointer at rest. The covariance holds the reading of the pointer and the seat; the error
/// of the facet's reading is common to all touches of a calibrator at rest and enters `calibrate_mount`.
MountObservation touched_place(const std::string& label, const geometry::RigidTransform& tracker_from_facet,
                               const geometry::RigidTransform& tracker_from_pointer,
                               const Eigen::Vector3d& tip_in_pointer, const MountOptions& options = {});

/// The place about which the calibrator was turned in a divot. A pivot gives this one point, no orientation:
/// a mount needs three.
MountObservation pivoted_place(const std::string& label, const PivotCalibration& facet);

struct MountResidual {
  std::string label;
  double distance_mm;  ///< from the place, or from the ball's surface
};

struct MountCalibration {
  geometry::RigidTransform calibrator_from_facet;
  PoseCovariance covariance;  ///< of it, along the calibrator's axes; with the facet's reading
  double fre_mm = 0;          ///< rms of the residuals
  double chi2 = 0;
  int dof = 0;
  Eigen::Vector3d tip_shift_mm;          ///< correction of tip_in_pointer within its covariance
  std::vector<MountResidual> residuals;  ///< in the order of the observations
  std::map<std::string, double> tre_mm;  ///< predicted rms error at each place, touched or not
  /// Places whose exchange these observations would not show.
  std::vector<std::pair<std::string, std::string>> exchangeable;
};

/// Pose of the facet in the calibrator by weighted least squares over the touched places, the pointer's tip
/// estimated along within its covariance. Refuses with figures: fewer than three places, places along one
/// line or fewer than seven equations (ten if the tip is not known; `poses_too_alike`); residuals beyond 99.9
/// % (`residual_too_large`), naming the exchanged or the displaced place, or a mirrored layout; a predicted
/// error above the limit
/// (`uncertain`), as of touches with one direction of a pointer whose tip has no covariance; an unknown label
/// (`bad_value`).
Expected<MountCalibration> calibrate_mount(const std::map<std::string, MountPlace>& places,
                                           std::span<const MountObservation> observations,
                                           const MountOptions& options = {});

}  // namespace helicarm::tracker
