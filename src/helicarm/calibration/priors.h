// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/centred_view.h"

namespace helicarm {

/// What is known of a number beforehand: a normal distribution.
struct NormalPrior {
  double value = 0;
  double sigma = 0;
};

/// What is known of one view's intrinsics before a ball is seen (rectified px), each where it is known.
struct IntrinsicsPrior {
  std::optional<double> focal_px = {};  ///< nominal mean of |fx| and fy
  std::optional<Eigen::Vector2d> principal_px = {};
  double unit_px = 1;  ///< the unit of CArmPrior in this view: px / mm on the receiver, or 1
  std::optional<NormalPrior> aspect = {};                   ///< |fx| / fy: 1 for square pixels
  std::optional<NormalPrior> skew = NormalPrior{0, 1e-12};  ///< over fy. Nothing: free
};

/// How a quantity departs from its nominal value: by an amount common to all views of a machine, and by what
/// each view adds (sag). Standard deviations.
struct IntrinsicsVariation {
  double common;
  double of_view;
};

/// How far a machine's intrinsics may be from nominal, in each view's unit (mm on the receiver). Nothing: not
/// known.
struct CArmPrior {
  std::optional<IntrinsicsVariation> focal;
  std::optional<IntrinsicsVariation> principal;  ///< per axis
};

/// What all views share.
struct CommonPrior {
  CArmPrior c_arm;
  /// Of each ball's place about the file's, mm^2, without the error of the scale; empty: exact.
  std::vector<Eigen::Matrix3d> ball_covariance_mm2 = {};
  double scale_sigma = 0;  ///< relative standard deviation of the calibrator's scale about the balls' mean
};

/// A start whose intrinsics the balls hardly fix, brought to what is known of them; its images change
/// little.
CentredView shrunk_to_prior(CentredView view, const IntrinsicsPrior& prior);

/// The priors as rows of a least-squares problem: `residuals` over `jacobian` by the steps of all views. Each
/// row is worth one observation.
struct PriorRows {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
};

PriorRows prior_rows(std::span<const CentredView> views, std::span<const IntrinsicsPrior> priors,
                     const CArmPrior& c_arm);

}  // namespace helicarm
