// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/symmetric_eigen.h"

#include <gtest/gtest.h>

namespace helicarm::geometry {
namespace {

TEST(SymmetricEigen, AscendingValuesAndOrthonormalVectorsRebuildTheMatrix) {
  Eigen::Matrix4d matrix;
  matrix << 4, 1, -2, 0.5, 1, 3, 0, 2, -2, 0, -1, 1, 0.5, 2, 1, 0;
  const auto [values, vectors] = symmetric_eigen(matrix);
  for (Eigen::Index k = 1; k < 4; ++k) EXPECT_LT(values[k - 1], values[k]);
  EXPECT_TRUE((vectors.transpose() * vectors).isIdentity(1e-14));
  EXPECT_TRUE((vectors * values.asDiagonal() * vectors.transpose()).isApprox(matrix, 1e-14));
}

}  // namespace
}  // namespace helicarm::geometry
