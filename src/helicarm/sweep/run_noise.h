// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

namespace helicarm::sweep {

/// One ball's residual in one frame about the path's camera, and the known variances per axis.
struct NoiseSample {
  std::size_t ball = 0;
  Eigen::Vector2d residual_px;
  double image_variance_px2 = 0;  ///< by the image's noise and background, as the detection states it
  double other_variance_px2 = 0;  ///< of the distortion map and the ball's position
  double free_share = 1;          ///< of the residual's variance that the fit of the camera leaves
};

/// Noise of the fiducials of a run: the variance that the detection states times a factor, and a floor, both
/// the same in the whole run. Residuals follow a t distribution (Lange et al. 1989): what lies over a ball
/// may displace its centre by more.
struct RunNoise {
  double freedom = 0;  ///< degrees of freedom of the distribution; infinite: normal
  double image_factor = 1, floor_px = 0;
  /// Of each sample, without the other variances, px^2: as informative as it is.
  std::vector<std::vector<double>> variance_px2;
  /// Factor, at least 1, in all of them: neighbouring frames share a part of their errors, which an average
  /// over them does not reduce as if they were independent.
  double shared = 1;
};

/// `frames`: the samples of each frame, in the order of the angle.
RunNoise noise_of(const std::vector<std::vector<NoiseSample>>& frames);

}  // namespace helicarm::sweep
