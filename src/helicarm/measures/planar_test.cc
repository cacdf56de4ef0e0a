// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/planar.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

namespace helicarm::measures {
namespace {

using Eigen::Vector2d;

TEST(Angle, RightAndStraightAndReflex) {
  EXPECT_NEAR(angle_deg({1, 0}, {0, 0}, {0, 5}), 90, 1e-12);
  EXPECT_NEAR(angle_deg({1, 0}, {0, 0}, {-2, 0}), 180, 1e-12);
  EXPECT_NEAR(angle_deg({1, 0}, {0, 0}, {1, -1}), 45, 1e-12);
  EXPECT_NEAR(line_angle_deg({1, 0}, {-1, 1}), 45, 1e-12);
}

TEST(FitCircle, ThreePointsLieOnIt) {
  const auto circle = fit_circle(PlanarPoints{{3, 0}, {0, 4}, {0, 0}});
  ASSERT_TRUE(circle);
  EXPECT_LT((circle->centre - Vector2d(1.5, 2)).norm(), 1e-12);
  EXPECT_NEAR(circle->radius, 2.5, 1e-12);
  EXPECT_NEAR(circle->residual_rms, 0, 1e-12);
}

TEST(FitCircle, ShortArcFarFromTheOrigin) {
  PlanarPoints arc;
  for (int i = 0; i < 12; ++i) {
    const double angle = 0.05 * i;
    arc.emplace_back(900 + 40 * std::cos(angle), 700 + 40 * std::sin(angle));
  }
  const auto circle = fit_circle(arc);
  ASSERT_TRUE(circle);
  EXPECT_LT((circle->centre - Vector2d(900, 700)).norm(), 1e-6);
}

TEST(FitCircle, LeastSquaresOfDistancesNotOfTheirSquares) {
  // Of points at radius 1 +- d alternately the mean distance is 1, that of the squares is not.
  PlanarPoints points;
  for (int i = 0; i < 8; ++i) {
    const double angle = std::numbers::pi * i / 4, radius = 1 + (i % 2 == 0 ? 0.2 : -0.2);
    points.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  const auto circle = fit_circle(points);
  ASSERT_TRUE(circle);
  EXPECT_NEAR(circle->radius, 1, 1e-9);
  EXPECT_NEAR(circle->residual_rms, 0.2, 1e-9);
}

TEST(FitCircle, PointsOnALineHaveNone) {
  EXPECT_FALSE(fit_circle(PlanarPoints{{0, 0}, {1, 1}, {2, 2}}));
  EXPECT_FALSE(fit_circle(PlanarPoints{{0, 0}, {1, 1}}));
  EXPECT_FALSE(fit_circle(PlanarPoints{{5, 5}, {5, 5}, {5, 5}}));
}

TEST(Percent, IsFreeOfTurnScaleAndMirroring) {
  const Vector2d zero(0, 0), hundred(8, 0), point(2, 3), along(1, 0), under(5, 6);
  const Eigen::Matrix2d turn = (Eigen::Matrix2d() << -1.2, 1.6, 1.6, 1.2).finished();  // mirrored, twice
  const Vector2d shift(30, -7);
  const auto moved = [&](const Vector2d& p) { return Vector2d(turn * p + shift); };
  EXPECT_NEAR(percent_along(point, zero, hundred, along), 25, 1e-12);
  EXPECT_NEAR(percent_across(point, zero, along, under), 50, 1e-12);
  EXPECT_NEAR(percent_along(moved(point), moved(zero), moved(hundred), turn * along), 25, 1e-9);
  EXPECT_NEAR(percent_across(moved(point), moved(zero), turn * along, moved(under)), 50, 1e-9);
}

TEST(Propagated, LinearFunctionIsExact) {
  const auto difference = [](const PlanarPoints& p) { return Eigen::VectorXd(p[1] - 2 * p[0]); };
  const Eigen::Matrix2d one = (Eigen::Matrix2d() << 4, 1, 1, 2).finished(),
                        other = Eigen::Matrix2d::Identity();
  const std::array covariances{one, other};
  const Eigen::Matrix2d expected = 4 * one + other;
  EXPECT_LT((propagated(difference, {{3, 4}, {-1, 7}}, covariances) - expected).norm(), 1e-6);
}

}  // namespace
}  // namespace helicarm::measures
