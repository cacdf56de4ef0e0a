// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <vector>

#include <Eigen/Core>

namespace helicarm {

/// Dots of a plate, normalised, and their raw pixels.
struct KrigingData {
  std::vector<Eigen::Vector2d> points;
  Eigen::MatrixX2d raw;
  Eigen::VectorXd weights;  ///< relative, mean one
  double variance = 0;      ///< of a dot of weight one, as its own sigma has it, px^2
};

/// Weighted (and, for kernels, penalised) linear least squares with its leave-one-out residuals.
struct LinearFit {
  Eigen::MatrixX2d coefficients;
  Eigen::MatrixX2d residuals;
  double held_out_rms = std::numeric_limits<double>::infinity();
  Eigen::VectorXd held_out;      ///< distance per dot
  Eigen::MatrixX2d studentized;  ///< residual over the root of what the dot itself has not drawn in, px
  double variance = 0;           ///< of a dot of weight one, as the residuals have it, px^2
  Eigen::MatrixXd covariance;    ///< of the coefficients, per axis; see DistortionMap
};

/// Raw pixels over places: a polynomial trend of some order and, of positive length, a Matern remainder.
struct KrigingModel {
  int order = 1;
  double length = 0;  ///< 0: no remainder
  double sigma = 0;   ///< of the remainder before any dot is seen, px
  LinearFit fit;      ///< without coefficients where the data do not carry it
};

KrigingModel polynomial_model(const KrigingData& data, int order);

/// Universal kriging. Length, strength and the dots' noise are those of the largest restricted likelihood.
KrigingModel smooth_model(const KrigingData& data, int order, const Eigen::MatrixX2d& knots);

}  // namespace helicarm
