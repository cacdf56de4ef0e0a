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
#include "helicarm/fiducials/fiducial.h"

namespace helicarm {

struct ViewFiducials {
  std::string name;
  std::vector<Fiducial> fiducials;  ///< those `used` count
  IntrinsicsPrior prior = {};
  std::optional<View> start = {};  ///< else the homogeneous DLT
  /// Of the map among the used fiducials, per axis (n x n, px^2), their sigmas holding its diagonal already.
  /// Empty: they err each alone.
  Eigen::MatrixXd map_covariance_px2 = {};
};

struct CalibrationOptions {
  CommonPrior common = {};
  double rejection_probability = 1e-4;  ///< of losing a good ball, 0 to 0.1; 0: none is rejected
  double largest_rms_px = 5;            ///< beyond it (and 3 sigma) labels or calibrator must be wrong
};

struct CalibrationResult : Calibration {
  std::vector<std::vector<Fiducial>> fiducials;  ///< per view, with residuals; false balls marked `rejected`
  double chi2 = 0;
  int dof = 0;
  double variance_scale = 1;  ///< inflation of the covariance where chi2 contradicts the fiducials' sigmas
  /// Per axis, of the balls' places, where the residuals ask for more than the calibrator's file states.
  double found_tolerance_mm = 0;
  double strain_sigma = 0;  ///< relative, of the calibrator's strain that the views show least; 0: not known
  double ball_rms_mm = 0;   ///< of the balls' estimated distances from the file; 0: they are taken as exact
  std::vector<Warning> warnings;  ///< few_fiducials, residual_too_large (inconsistent sigmas),
                                  ///< calibrator_strained, calibrator_deviates
  std::vector<Warning> notes;     ///< calibrator_deviates, within the stated tolerance
};

/// Pinhole views without skew by maximum likelihood, all views at once, under the priors. False balls are
/// found by peeling off the worst one by one and testing which removals mattered (Rosner 1983); at least 6
/// are kept in each view. Where the file states no tolerance and the residuals are inconsistent, the balls
/// may lie off their places by the same amount in all views (`fit_ball_offsets`). Refuses, naming the view:
/// `too_few_fiducials`, `coplanar_fiducials`, `behind_source`, `uncertain` (the balls leave the view open),
/// `residual_too_large`; `bad_value` for a sigma that is not positive.
Expected<CalibrationResult> calibrate(const std::vector<ViewFiducials>& views,
                                      const CalibrationOptions& options);

/// The published recipe: Eq. 7 for each view alone, no fiducial rejected. No covariance; dof = 2n - 11.
Expected<CalibrationResult> calibrate_paper(const std::vector<ViewFiducials>& views,
                                            const CalibrationOptions& options);

/// Refuses `views_too_close` unless two views look at a point (the balls' centre, say) from directions that
/// differ, as lines, by at least `least_deg`.
Expected<void> check_views_apart(std::span<const CalibratedView> views,
                                 const Eigen::Vector3d& point_in_calibrator, double least_deg = 30);

}  // namespace helicarm
