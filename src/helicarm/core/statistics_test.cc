// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/statistics.h"

#include <array>
#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace helicarm {
namespace {

TEST(Statistics, MedianOfAnEvenCountIsTheUpperOfTwo) {
  EXPECT_EQ(median(std::vector<double>{4, 1, 3, 2}), 3);
  EXPECT_EQ(median(std::array{5, 1, 3}), 3);
}

TEST(Statistics, QuantilesAreValuesOfTheList) {
  std::vector<float> values{50, 10, 40, 20, 30};
  EXPECT_EQ(quantile(values, 0), 10);
  EXPECT_EQ(quantile(values, 0.5), 30);
  EXPECT_EQ(quantile(values, 1), 50);
}

TEST(Statistics, ChiSquareQuantilesAreThoseOfTables) {
  constexpr double normal_at_95 = 1.6448536;
  EXPECT_NEAR(chi2_quantile(10, normal_at_95), 18.307, 0.02);
  EXPECT_NEAR(chi2_quantile(100, normal_at_95), 124.342, 0.02);
  EXPECT_NEAR(chi2_quantile(6, normal_at_999), 22.458, 0.25);
}

TEST(Statistics, ExcessInvertsTheQuantile) {
  for (const double dof : {1., 5., 40., 1000.})
    for (const double sigmas : {0.5, 2., 6.})
      EXPECT_NEAR(chi2_excess(chi2_quantile(dof, sigmas), dof), sigmas, 1e-9);
}

}  // namespace
}  // namespace helicarm
