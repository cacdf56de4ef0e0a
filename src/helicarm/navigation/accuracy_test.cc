// SPDX-License-Identifier: Apache-2.0
#include "helicarm/navigation/accuracy.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm {
namespace {

TEST(StatisticsOf, KnownValues) {
  const std::vector<double> values = {3, 4, 5};
  const auto s = statistics_of(values);
  ASSERT_TRUE(s);
  EXPECT_DOUBLE_EQ(s->mean, 4);
  EXPECT_DOUBLE_EQ(s->rms, std::sqrt(50 / 3.0));
  EXPECT_EQ(s->max, 5);
  EXPECT_EQ(s->min, 3);
  EXPECT_EQ(s->n, 3u);
}

TEST(StatisticsOf, NoValuesHaveNone) { EXPECT_FALSE(statistics_of({})); }

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

TEST(EstimateLocalizationError, ScalesResidualsByTheDegreesOfFreedom) {
  Fiducial used{"P1", Eigen::Vector3d::Zero()};
  used.status = FiducialStatus::used;
  used.residual_px = 0.1;
  Fiducial rejected = used;
  rejected.status = FiducialStatus::rejected;
  std::vector<Fiducial> of_view(12, used);
  of_view.push_back(rejected);
  const std::vector<std::vector<Fiducial>> fiducials = {of_view, of_view};
  CalibratedView view;
  view.dof = 14;
  const std::vector<CalibratedView> views = {view, view};
  const auto error = estimate_localization_error(fiducials, views);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->n, 24u);
  EXPECT_NEAR(error->rms, std::sqrt(2 * 24 * 0.01 / 28), 1e-12);
  EXPECT_NEAR(error->mean, error->rms * std::sqrt(std::numbers::pi) / 2, 1e-12);
}

}  // namespace
}  // namespace helicarm
