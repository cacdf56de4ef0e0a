// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include <Eigen/Core>

namespace helicarm {

/// One row for each parameter, one column for each pixel.
using PixelRows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Sum over the pixels of weight * row_i * row_j, one weight for each pixel: the whole
/// symmetric matrix. The order of the additions is fixed by the numbers of rows and pixels alone.
Eigen::MatrixXd weighted_products(const PixelRows& rows, std::span<const float> weights);

}  // namespace helicarm
