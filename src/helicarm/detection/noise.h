// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

#include <Eigen/Core>

#include "helicarm/detection/normal_equations.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::detection {

/// Noise correlation between pixels due to detector blur: share along[|i|] along[|j|] at a lag of (i, j)
/// pixels, and 1 at (0, 0).
struct NoiseCorrelation {
  static constexpr int reach = 5;
  float share = 0;  ///< fraction of the variance that is blurred; the rest is white
  std::array<float, reach + 1> along{1, 0, 0, 0, 0, 0};
};

/// Correlation of most of the image's blocks after removing a quadratic from each. White if too few blocks
/// lie inside the field.
NoiseCorrelation noise_correlation(const xray::XrayImage& xray_image, float floor, float ceiling);

/// With the image's own limits.
NoiseCorrelation noise_correlation(const xray::XrayImage& xray_image);

/// Sum over all pairs of pixels of their correlation times row_i row_j': the middle factor of the covariance
/// between two inverse normal matrices. `cells`: each pixel's index in a grid of the given width, row by row.
Eigen::MatrixXd correlated_normal(const NoiseCorrelation& noise, const PixelRows& rows,
                                  std::span<const int> cells, int width);

}  // namespace helicarm::detection
