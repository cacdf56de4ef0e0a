// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/calibration/priors.h"
#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/fiducials/fiducial.h"

namespace helicarm::calibration {

struct ViewFiducials {
  std::string name;
  /// Only those `used` enter. All views list the same fiducials in one order (`aligned_by_label`).
  std::vector<fiducials::Fiducial> fiducials;
  geometry::IntrinsicsPrior prior = {};
  std::optional<geometry::View> start = {};  ///< else the homogeneous DLT
  /// Covariance of the map among the used fiducials, per axis (n x n, px^2); its diagonal is part of their
  /// sigmas. Empty: independent errors.
  Eigen::MatrixXd map_covariance_px2 = {};
};

inline constexpr Range rejection_range{0, 0.1};     ///< of CalibrationOptions::rejection_probability
inline constexpr double least_view_angle_deg = 30;  ///< between two views

struct CalibrationOptions {
  CommonPrior common = {};
  double rejection_probability = 1e-4;  ///< of rejecting an inlier; 0: no rejection
  double largest_rms_px = 5;            ///< refused above it and 3 sigma
};

/// Residual of a used fiducial's image point, and what the fit leaves of the assumed noise there.
struct ImageResidual {
  double length_px;  ///< from the image of its estimated position
  double sigma_px;   ///< assumed of the image point, per axis, the map's error included
  /// Of the residual, if the noise is as assumed: below sigma^2 I by what the fitted parameters absorb.
  Eigen::Matrix2d covariance_px2;
};

struct CalibrationResult : Calibration {
  std::vector<std::vector<ImageResidual>> image_residuals;  ///< per view, of the used fiducials
  /// Of the fiducials' coordinates per axis, estimated where the residuals require more than the file's.
  double found_tolerance_mm = 0;
  /// Of the views' parameters (11 a view), by unit errors of the fiducials' coordinates (`OffsetRoots`): the
  /// estimate's error that they make, with its sign. Its square is a part of the joint covariance. No
  /// columns: exact.
  Eigen::MatrixXd by_ball_errors;
  double strain_sigma = 0;  ///< relative, of the calibrator's least observable strain; 0: not known
  double ball_rms_mm = 0;   ///< of the fiducials' estimated offsets from the file; 0: taken as exact
  /// Strain, offsets beyond the stated tolerance, or diameters are significant: a warning says which.
  bool contradicts_calibrator = false;
  std::vector<Warning> warnings;  ///< few_fiducials, residual_too_large (inconsistent sigmas),
                                  ///< calibrator_strained, calibrator_deviates
  std::vector<Warning> notes;     ///< calibrator_deviates, within the stated tolerance
};

/// Joint maximum-likelihood calibration of pinhole views under the priors. Outliers are rejected by the test
/// of Rosner (1983); at least 6 fiducials are kept in each view. If the file states no tolerance and the
/// residuals are inconsistent, offsets of the fiducials common to all views are estimated
/// (`fit_ball_offsets`). Refuses, with the view: `too_few_fiducials`, `coplanar_fiducials`, `behind_source`,
/// `uncertain` (the view is not constrained), `residual_too_large`; `bad_value` for a sigma that is not
/// positive.
Expected<CalibrationResult> calibrate(const std::vector<ViewFiducials>& views,
                                      const CalibrationOptions& options);

/// The paper's method: Eq. 7 for each view alone, without rejection and covariance; dof = 2n - 11.
Expected<CalibrationResult> calibrate_paper(const std::vector<ViewFiducials>& views,
                                            const CalibrationOptions& options);

/// Refuses `views_too_close` unless the rays of two views through a point (such as the fiducials' centre)
/// differ, as lines, by at least `least_deg`.
Expected<void> check_views_apart(std::span<const CalibratedView> views,
                                 const Eigen::Vector3d& point_in_calibrator,
                                 double least_deg = least_view_angle_deg);

}  // namespace helicarm::calibration
