// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/error_bound.h"

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::localization {
namespace {

TEST(LengthAt95, OneTwoAndThreeEqualAxes) {
  const auto length = [](double x, double y, double z) {
    return length_at_95(Eigen::Vector3d(x, y, z).asDiagonal());
  };
  EXPECT_NEAR(length(4, 0, 0), 2 * 1.95996, 0.05);
  EXPECT_NEAR(length(4, 4, 0), 2 * 2.44775, 0.05);
  EXPECT_NEAR(length(4, 4, 4), 2 * 2.79548, 0.05);
  EXPECT_EQ(length(0, 0, 0), 0);
}

TEST(LengthAt95, UnequalAxesHoldNinetyFivePercent) {
  const Eigen::Vector3d sigma(1, 2, 0.5);
  const double limit = length_at_95(sigma.cwiseAbs2().asDiagonal());
  RandomStream stream(1, 2);
  int within = 0;
  constexpr int trials = 50000;
  for (int i = 0; i < trials; ++i)
    within += sigma.cwiseProduct(Eigen::Vector3d(stream.normal(), stream.normal(), stream.normal())).norm() <=
              limit;
  EXPECT_NEAR(within / double(trials), 0.95, 0.006);
}

}  // namespace
}  // namespace helicarm::localization
