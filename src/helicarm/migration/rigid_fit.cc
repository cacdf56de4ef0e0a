// SPDX-License-Identifier: Apache-2.0
#include "helicarm/migration/rigid_fit.h"

#include <Eigen/LU>

#include "helicarm/track/body_pose.h"

namespace helicarm::migration {

RigidFit fit_rigid(const std::vector<Pair>& pairs) {
  std::vector<Eigen::Vector3d> first, second;
  for (const Pair& pair : pairs) first.push_back(pair.first), second.push_back(pair.second);
  RigidFit fit;
  fit.second_from_first = geometry::absolute_pose(first, second);
  fit.centre = geometry::mean_of(second);
  registration::RigidCovariance normal = registration::RigidCovariance::Zero(), meat = normal,
                                meat_of_squares = normal;
  double trace_of_squares = 0;
  for (const Pair& pair : pairs) {
    const Eigen::Vector3d at = fit.second_from_first * pair.first;
    const auto slope = track::point_by_step(at, fit.centre);
    normal += slope.transpose() * slope;
    meat += slope.transpose() * pair.spread * slope;
    meat_of_squares += slope.transpose() * pair.spread * pair.spread * slope;
    trace_of_squares += pair.spread.squaredNorm();
    const double residual = (pair.second - at).norm();
    fit.residual_mm.push_back(residual);
    fit.mean_error_mm += residual / double(pairs.size());
    fit.squares_mm2 += residual * residual;
    fit.expected_squares_mm2 += pair.spread.trace();
  }
  const registration::RigidCovariance inverse = normal.inverse();
  fit.covariance = inverse * meat * inverse;
  fit.expected_squares_mm2 -= (inverse * meat).trace();
  // Residuals R V R of errors V, with R = 1 - A (A'A)^-1 A': the variance of their squares is 2 tr (R V R)^2.
  fit.squares_variance_mm4 = 2 * (trace_of_squares - 2 * (inverse * meat_of_squares).trace() +
                                  (inverse * meat * inverse * meat).trace());
  return fit;
}

}  // namespace helicarm::migration
