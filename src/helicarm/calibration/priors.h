// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "helicarm/calibration/centred_view.h"

namespace helicarm {

/// What is known of a number beforehand: a normal distribution.
struct Belief {
  double value = 0;
  double sigma = 0;
};

struct PrincipalBelief {
  Eigen::Vector2d value = Eigen::Vector2d::Zero();
  double sigma = 0;  ///< per axis
};

/// What is known of a view's intrinsics before a ball is seen (rectified px), each where it is known.
struct IntrinsicsPrior {
  std::optional<Belief> focal_px;  ///< mean of |fx| and fy
  std::optional<Belief> aspect;    ///< |fx| / fy: 1 for square pixels
  std::optional<PrincipalBelief> principal_px;
};

/// How far the intrinsics of one machine wander from view to view (sag): standard deviation of the difference
/// of two views, px.
struct SpreadPrior {
  std::optional<double> focal_px;
  std::optional<double> principal_px;  ///< per axis
};

/// The priors as rows of a least-squares problem: `residuals` over `jacobian` by the steps of all views.
struct PriorRows {
  Eigen::VectorXd residuals;
  Eigen::MatrixXd jacobian;
  int independent = 0;  ///< how many observations they are worth
};

PriorRows prior_rows(std::span<const CentredView> views, std::span<const IntrinsicsPrior> priors,
                     const SpreadPrior& spread);

}  // namespace helicarm
