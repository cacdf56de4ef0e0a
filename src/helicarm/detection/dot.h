// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include <Eigen/Core>

namespace helicarm {

/// The image of a ball or of a hole, in raw pixels.
struct Dot {
  Eigen::Vector2d centre_px;  ///< sub-pixel
  double sigma_px = 0;        ///< standard deviation of the centre by the noise, per axis
  double jackknife_px = 0;    ///< how far the centre goes, per axis, when one side is left out
  double radius_px = 0;
  double contrast = 0;  ///< grey value of the background less that of the dot: negative for a bright dot
  double misfit = 0;    ///< rms of the fit's residual over |contrast|

  /// Standard deviation of the centre, per axis: by the noise, or by the sides' contradiction where that is
  /// more than chance.
  double error_px() const;
};

/// A variance by the noise, or by a jackknife of eight groups where that is more than chance would have it
/// (above the 95th percentile for two axes).
inline double prior_variance(double noise, double jackknife) {
  constexpr double chance = 1.69;
  return jackknife > chance * noise ? jackknife : noise;
}

inline double Dot::error_px() const {
  return std::sqrt(prior_variance(sigma_px * sigma_px, jackknife_px * jackknife_px));
}

}  // namespace helicarm
