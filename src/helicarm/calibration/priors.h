// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/centred_view.h"
#include "helicarm/geometry/intrinsics_prior.h"

namespace helicarm::calibration {

/// Standard deviations of a quantity from nominal: common to all views of a C-arm, and of each view (sag).
struct IntrinsicsVariation {
  double common;
  double of_view;
};

/// Intrinsics variation of a C-arm, in each view's unit (mm on the detector). Nothing: unknown.
struct CArmPrior {
  std::optional<IntrinsicsVariation> focal;
  std::optional<IntrinsicsVariation> principal;  ///< per axis
  /// Of focal length and principal point (u, v), mm: how the nominal values, learnt with the same calibrator,
  /// follow from unit errors of its fiducials' coordinates (`OffsetRoots::directions`). No columns: not.
  Eigen::Matrix3Xd by_ball_errors = {};
};

/// Priors common to all views.
struct CommonPrior {
  CArmPrior c_arm;
  /// Of each fiducial's coordinates, mm^2, without the scale's error; empty: exact.
  std::vector<Eigen::Matrix3d> ball_covariance_mm2 = {};
  /// Of all fiducials' coordinates together (3n x 3n), where their errors are correlated: replaces
  /// `ball_covariance_mm2`.
  Eigen::MatrixXd joint_ball_covariance_mm2 = {};
  double scale_sigma = 0;  ///< of the calibrator's scale about the fiducials' mean, relative
  /// Digest of the fiducials' coordinates and covariances: errors of one calibrator are the same in all its
  /// images. Empty: exact.
  std::string calibrator = {};
};

/// `view` with its intrinsics set to the prior where one exists; its projections change little. For a start
/// whose intrinsics are poorly constrained.
CentredView shrunk_to_prior(CentredView view, const geometry::IntrinsicsPrior& prior);

/// Deviations from nominal that all views of a C-arm share, in their standard deviations: of the focal length
/// and of the principal point along u and v.
using CArmDeviation = Eigen::Vector3d;

/// A view's priors as whitened rows of a least-squares problem in its step, the C-arm's deviation and the
/// fiducials' unit errors.
struct PriorRows {
  Eigen::VectorXd residuals;
  Eigen::Matrix<double, Eigen::Dynamic, view_parameters> by_step;
  Eigen::Matrix<double, Eigen::Dynamic, 3> by_c_arm;
  Eigen::MatrixXd by_ball_errors;  ///< columns as those of `CArmPrior::by_ball_errors`
};

/// `ball_errors`: in standard deviations, one for each column of `c_arm.by_ball_errors`.
PriorRows prior_rows(const CentredView& view, const geometry::IntrinsicsPrior& prior, const CArmPrior& c_arm,
                     const CArmDeviation& deviation, const Eigen::VectorXd& ball_errors = {});

}  // namespace helicarm::calibration
