// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

namespace helicarm::simulation {

/// A local distortion of the intensifier's screen: a Gaussian displacement.
struct DistortionBump {
  Eigen::Vector2d centre_px;
  double sigma_px;
  Eigen::Vector2d shift_px;
};

/// Maps raw to ideal pixels in closed form. With rho the distance from `centre_px` over `radius_px`, the
/// offset from the centre is scaled by 1 + k1 rho^2 + k2 rho^4 (curved input screen; pincushion: k1 < 0),
/// rotated by s_rotation * sin(pi rho^2 / 2) (the earth's field) and shifted. Deliberately not a polynomial,
/// unlike the model that is fitted to it.
struct IntensifierDistortion {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  double radius_px = 1;
  double k1 = 0;
  double k2 = 0;
  double s_rotation = 0;  ///< rad
  Eigen::Vector2d shift_px = Eigen::Vector2d::Zero();
  std::vector<DistortionBump> bumps;

  Eigen::Vector2d ideal_from_raw(const Eigen::Vector2d& raw) const;
  /// Inverse, accurate to 1e-10 px.
  Eigen::Vector2d raw_from_ideal(const Eigen::Vector2d& ideal) const;
};

}  // namespace helicarm::simulation
