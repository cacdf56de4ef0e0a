// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/normal_equations.h"

#include <vector>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::detection {
namespace normal_equations_test {

class WeightedProducts : public testing::TestWithParam<std::pair<int, int>> {};

TEST_P(WeightedProducts, AgreeWithMatrixProducts) {
  const auto [parameters, pixels] = GetParam();
  RandomStream random(5, 1);
  const PixelRows rows = PixelRows::NullaryExpr(parameters, pixels, [&] { return float(random.normal()); });
  std::vector<float> weights;
  for (int i = 0; i < pixels; ++i) weights.push_back(float(random.uniform(0, 1)));
  const Eigen::VectorXd w = Eigen::Map<const Eigen::VectorXf>(weights.data(), pixels).cast<double>();
  const Eigen::MatrixXd plain = rows.cast<double>() * w.asDiagonal() * rows.cast<double>().transpose();
  EXPECT_LT((weighted_products(rows, weights) - plain).cwiseAbs().maxCoeff(), 1e-4 * (1 + plain.norm()));
}

// Tiles of 4 x 3 rows, 8 SIMD elements and blocks of 1024 pixels, whole and partial.
INSTANTIATE_TEST_SUITE_P(Sizes, WeightedProducts,
                         testing::Values(std::pair{1, 1}, std::pair{3, 7}, std::pair{4, 8},
                                         std::pair{12, 887}, std::pair{13, 1024}, std::pair{14, 1025},
                                         std::pair{29, 3001}));

TEST(WeightedProducts, PixelsOfZeroWeightAreIgnored) {
  PixelRows rows = PixelRows::Constant(2, 16, 3);
  rows.rightCols(8).setConstant(1e30f);
  std::vector<float> weights(16, 0);
  std::fill_n(weights.begin(), 8, 1.f);
  EXPECT_EQ(weighted_products(rows, weights)(1, 0), 72);
}

}  // namespace normal_equations_test
}  // namespace helicarm::detection
