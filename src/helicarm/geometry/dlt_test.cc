// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/dlt.h"

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {
namespace {

std::vector<Eigen::Vector3d> helix(int n) {
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < n; ++k) {
    const double t = std::numbers::pi / 6 + k * 6.6 * std::numbers::pi / n;
    points.push_back(
        {60 * std::exp(-t / 31.529) * std::cos(t), 60 * std::exp(-t / 31.529) * std::sin(t), 3.979 * t});
  }
  return points;
}

/// The views of 2.3.3: f = 900 mm, 0.15 mm pixels, 800 mm from the source.
View paper_view(double alpha) {
  return {{6000, 6000, 512, 512, 0}, {rotation_from_euler(alpha, 0, 0), {0, 0, 800}}};
}

std::vector<PointPair> pictured(const View& view, const std::vector<Eigen::Vector3d>& points,
                                double sigma = 0) {
  RandomStream random(7, 0);
  std::vector<PointPair> pairs;
  for (const auto& p : points)
    pairs.push_back({p, view.project(p) + sigma * Eigen::Vector2d(random.normal(), random.normal())});
  return pairs;
}

/// Reference: the normal equations as published, in extended precision.
DltFactors normal_equations(const std::vector<PointPair>& pairs) {
  using Wide = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const Eigen::Index n = Eigen::Index(pairs.size());
  Wide e = Wide::Zero(2 * n, 11), c(2 * n, 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& [p, uv] = pairs[std::size_t(i)];
    e.row(i) << p.x(), p.y(), p.z(), 1, -p.x() * uv.x(), -p.y() * uv.x(), -p.z() * uv.x(), 0, 0, 0, 0;
    e.row(n + i) << 0, 0, 0, 0, -p.x() * uv.y(), -p.y() * uv.y(), -p.z() * uv.y(), p.x(), p.y(), p.z(), 1;
    c(i) = uv.x();
    c(n + i) = uv.y();
  }
  const Wide solution = (e.transpose() * e).fullPivLu().solve(e.transpose() * c);
  return solution.col(0).cast<double>();
}

TEST(Dlt, RecoversTheViewFromExactImages) {
  for (const View& truth : {paper_view(0), paper_view(std::numbers::pi / 2)})
    for (int n : {6, 12, 20}) {
      const auto pairs = pictured(truth, helix(n));
      for (const auto& result : {dlt_least_squares(pairs), dlt_homogeneous(pairs)}) {
        ASSERT_TRUE(result.has_value()) << result.error().message;
        EXPECT_LT((result->view.projection() - truth.projection()).norm() / truth.projection().norm(), 1e-8);
        EXPECT_LT(reprojection_rms(result->view, pairs), 1e-9);
      }
    }
}

TEST(Dlt, LeastSquaresAgreesWithTheNormalEquations) {
  for (double alpha : {0.0, 1.0, 1.5707963267948966}) {
    const auto pairs = pictured(paper_view(alpha), helix(12), 2.34);
    const auto result = dlt_least_squares(pairs);
    ASSERT_TRUE(result.has_value()) << result.error().message;
    const DltFactors oracle = normal_equations(pairs);
    for (int i = 0; i < 11; ++i) EXPECT_NEAR((*result->factors)(i) / oracle(i), 1, 1e-9) << i;
  }
}

TEST(Dlt, FactorsAndProjectionAreEquivalent) {
  const Projection p = paper_view(0.4).projection();
  const auto factors = factors_from_projection(-3 * p);
  ASSERT_TRUE(factors.has_value());
  EXPECT_LT((projection_from_factors(*factors) * p(2, 3) - p).norm(), 1e-9);
}

TEST(Dlt, MirroredImageHasNegativeFx) {
  View truth = paper_view(0.5);
  truth.intrinsics.fx *= -1;
  const auto result = dlt_least_squares(pictured(truth, helix(12)));
  ASSERT_TRUE(result.has_value());
  EXPECT_NEAR(result->view.intrinsics.fx, -6000, 1e-4);
  EXPECT_GT(result->view.depth({0, 0, 40}), 0);
}

TEST(Dlt, OriginInTheSourcePlaneIsSingularOnlyInThePrintedForm) {
  View truth = paper_view(0);
  auto points = helix(12);
  for (auto& p : points) p.z() += 800;
  truth.camera_from_world.translation.z() = 0;
  const auto pairs = pictured(truth, points);
  EXPECT_EQ(dlt_least_squares(pairs).error().reason, Reason::point_at_infinity);
  const auto result = dlt_homogeneous(pairs);
  ASSERT_TRUE(result.has_value());
  EXPECT_FALSE(result->factors.has_value());
  EXPECT_LT((result->view.projection() - truth.projection()).norm() / truth.projection().norm(), 1e-8);
}

TEST(Dlt, CoplanarAndCollinearPointsAreRefusedAtAnyNoise) {
  for (double sigma : {0.0, 1.0}) {
    auto flat = helix(12), line = helix(12);
    for (auto& p : flat) p.z() = 0.3 * p.x() - 0.2 * p.y();
    for (auto& p : line) p = Eigen::Vector3d(1, 2, 3) * p.z();
    for (const auto& points : {flat, line})
      for (const auto& result : {dlt_least_squares(pictured(paper_view(0.3), points, sigma)),
                                 dlt_homogeneous(pictured(paper_view(0.3), points, sigma))}) {
        ASSERT_FALSE(result.has_value());
        EXPECT_EQ(result.error().reason, Reason::coplanar_fiducials);
        EXPECT_GT(result.error().figures.at("condition"), 1e3);
      }
  }
}

TEST(Dlt, ConditionGrowsAsThePointsApproachAPlane) {
  double before = 0;
  for (double height : {1.0, 0.1, 0.01}) {
    auto points = helix(12);
    for (auto& p : points) p.z() *= height;
    const auto condition = dlt_condition(pictured(paper_view(1.2), points, 0.1));
    ASSERT_TRUE(condition.has_value());
    EXPECT_GT(*condition, 5 * before);
    before = *condition;
  }
}

TEST(Dlt, FivePointsAndNanAreRefused) {
  auto pairs = pictured(paper_view(0), helix(5));
  EXPECT_EQ(dlt_least_squares(pairs).error().reason, Reason::too_few_fiducials);
  pairs = pictured(paper_view(0), helix(8));
  pairs[3].pixel.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(dlt_homogeneous(pairs).error().reason, Reason::not_finite);
}

TEST(Dlt, ImagesAllInOnePixelAreRefused) {
  auto pairs = pictured(paper_view(0), helix(8));
  for (auto& p : pairs) p.pixel = {5, 5};
  EXPECT_EQ(dlt_homogeneous(pairs).error().reason, Reason::coplanar_fiducials);
}

}  // namespace
}  // namespace helicarm::geometry
