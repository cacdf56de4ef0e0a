// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <vector>

#include <Eigen/Core>

namespace helicarm::rectification {

/// Dots of a plate, normalised, and their raw pixels.
struct KrigingData {
  std::vector<Eigen::Vector2d> points;
  Eigen::MatrixX2d raw;
  Eigen::VectorXd weights;  ///< relative, mean 1
  double variance = 0;      ///< of a dot of weight one according to its own sigma, px^2
};

/// Weighted (and, for kernels, penalised) linear least squares with leave-one-out residuals.
struct LinearFit {
  Eigen::MatrixX2d coefficients;
  Eigen::MatrixX2d residuals;
  double held_out_rms = std::numeric_limits<double>::infinity();
  Eigen::VectorXd held_out;      ///< distance per dot
  Eigen::MatrixX2d studentized;  ///< residual over the root of the dot's redundancy, px
  double variance = 0;           ///< of a dot of weight one according to the residuals, px^2
  Eigen::MatrixXd covariance;    ///< of the coefficients, per axis; see DistortionMap
};

/// Raw pixels as a function of position: a polynomial trend and, for positive length, a Matern remainder.
struct KrigingModel {
  int order = 1;
  double length = 0;  ///< 0: no remainder
  double sigma = 0;   ///< prior standard deviation of the remainder, px
  LinearFit fit;      ///< without coefficients if the data do not determine it
};

KrigingModel polynomial_model(const KrigingData& data, int order);

/// Universal kriging. Length, strength and dot noise maximise the restricted likelihood.
KrigingModel smooth_model(const KrigingData& data, int order, const Eigen::MatrixX2d& knots);

}  // namespace helicarm::rectification
