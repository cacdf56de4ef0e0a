// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

#include <Eigen/Core>

#include "helicarm/detection/normal_equations.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm {

/// How the noise of an image's pixels hangs together: the blur of a detector spreads each quantum over some
/// pixels. Correlation at a distance of (i, j) pixels: share along[|i|] along[|j|], and 1 at (0, 0).
struct NoiseCorrelation {
  static constexpr int reach = 5;
  float share = 0;  ///< of the variance that is blurred; the rest is white
  std::array<float, reach + 1> along{1, 0, 0, 0, 0, 0};
};

/// The correlation that most of the image's blocks have, after a quadratic is taken off each. White where
/// too few blocks lie inside the field.
NoiseCorrelation noise_correlation(const XrayImage& xray_image, float floor, float ceiling);

/// The same within the exposure's own limits.
NoiseCorrelation noise_correlation(const XrayImage& xray_image);

/// Sum over all pairs of pixels of their correlation times row_i row_j': what stands between two inverse
/// normal matrices in a covariance. `cells`: each pixel's place in a grid of the given width, row by row.
Eigen::MatrixXd correlated_normal(const NoiseCorrelation& noise, const PixelRows& rows,
                                  std::span<const int> cells, int width);

}  // namespace helicarm
