// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

namespace helicarm::detection {

/// One row per parameter, one column per pixel.
using PixelRows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Sum over the pixels of weight * row_i * row_j: the whole symmetric matrix. The order of summation depends
/// only on the numbers of rows and pixels.
Eigen::MatrixXd weighted_products(const PixelRows& rows, std::span<const float> weights);

}  // namespace helicarm::detection
