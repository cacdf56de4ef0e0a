// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include <Eigen/Core>

namespace helicarm::detection {

/// Image of a ball or a hole, raw pixels.
struct Dot {
  Eigen::Vector2d centre_px;  ///< sub-pixel
  double sigma_px = 0;        ///< standard deviation of the centre per axis due to noise
  double jackknife_px = 0;    ///< shift of the centre per axis when one sector is left out (jackknife)
  double radius_px = 0;
  double contrast = 0;  ///< background minus dot grey value: negative for a bright dot
  double misfit = 0;    ///< rms of the fit's residual over |contrast|

  /// Standard deviation of the centre per axis: from the noise, or from the jackknife where it is
  /// significantly larger.
  double error_px() const;
};

/// Variance from the noise, or from a jackknife of eight groups where it is significantly larger (above the
/// 95th percentile for two axes).
inline double prior_variance(double noise, double jackknife) {
  constexpr double chance = 1.69;
  return jackknife > chance * noise ? jackknife : noise;
}

inline double Dot::error_px() const {
  return std::sqrt(prior_variance(sigma_px * sigma_px, jackknife_px * jackknife_px));
}

}  // namespace helicarm::detection
