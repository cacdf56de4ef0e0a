// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/triangulation.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/dlt.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::geometry {
namespace {

View view_at(double alpha) {
  return {{6000, 6000, 512, 512, 0}, {rotation_from_euler(alpha, 0, 0), {0, 0, 800}}};
}

std::vector<RayObservation> observations_of(const Eigen::Vector3d& point,
                                            std::initializer_list<double> alphas) {
  std::vector<RayObservation> ray_observations;
  for (double alpha : alphas) ray_observations.push_back({view_at(alpha), view_at(alpha).project(point)});
  return ray_observations;
}

Eigen::MatrixXd white(const std::vector<RayObservation>& ray_observations, double sigma) {
  const auto n = 2 * Eigen::Index(ray_observations.size());
  return sigma * sigma * Eigen::MatrixXd::Identity(n, n);
}

TEST(Intersect, ExactPixelsGiveThePointFromTwoOrMoreViews) {
  const Eigen::Vector3d point(20, -35, 48);
  for (const auto& ray_observations :
       {observations_of(point, {0, 1.57}), observations_of(point, {0, 0.6, 1.3, 2})}) {
    const auto found = intersect(ray_observations, white(ray_observations, 0));
    ASSERT_TRUE(found.has_value()) << found.error().message;
    EXPECT_LT((found->point - point).norm(), 1e-9);
    EXPECT_LT(found->ray_gap_mm, 1e-9);
  }
}

TEST(IntersectLinear, CorrectedEquationEightAcceptsFactorsOrProjections) {
  const Eigen::Vector3d point(20, -35, 48);
  const auto ray_observations = observations_of(point, {0, 1.57});
  std::vector<Projection> as_printed;
  std::vector<Eigen::Vector2d> pixels;
  for (const RayObservation& s : ray_observations) {
    as_printed.push_back(projection_from_factors(*factors_from_projection(s.view.projection())));
    pixels.push_back(s.pixel);
  }
  const auto found = intersect_linear(as_printed, pixels);
  ASSERT_TRUE(found.has_value());
  EXPECT_LT((*found - point).norm(), 1e-9);
}

TEST(ProjectionJacobian, AgreesWithDifferences) {
  const View view{{-6000, 6100, 500, 520, 3}, {rotation_from_euler(0.2, 0.7, -1), {20, -30, 800}}};
  const Eigen::Vector3d point(40, -10, 60);
  const auto jacobian = projection_jacobian(view, point);
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d step = 1e-4 * Eigen::Vector3d::Unit(i);
    const Eigen::Vector2d slope = (view.project(point + step) - view.project(point - step)) / 2e-4;
    EXPECT_LT((slope - jacobian.col(i)).norm(), 1e-6);
  }
}

TEST(Intersect, NoisyPixelsScatterAsPredicted) {
  const Eigen::Vector3d point(20, -35, 48);
  const auto truth = observations_of(point, {0, 1.2});
  Eigen::MatrixXd covariance = white(truth, 1);
  covariance(0, 0) = 9;  // one coordinate is noisier
  const Eigen::MatrixXd root = covariance.llt().matrixL();
  RandomStream random(5, 0);
  double error2 = 0, chi2 = 0, predicted = 0;
  const int trials = 4000;
  for (int i = 0; i < trials; ++i) {
    Eigen::Vector4d noise;
    for (double& x : noise) x = random.normal();
    noise = root * noise;
    auto ray_observations = truth;
    ray_observations[0].pixel += noise.head<2>();
    ray_observations[1].pixel += noise.tail<2>();
    const auto found = intersect(ray_observations, covariance);
    ASSERT_TRUE(found.has_value());
    error2 += (found->point - point).squaredNorm() / trials;
    chi2 += found->chi2 / trials;
    predicted += found->covariance.trace() / trials;
  }
  EXPECT_NEAR(error2 / predicted, 1, 0.05);
  EXPECT_NEAR(chi2, 1, 0.07);  // 4 equations, 3 unknowns
}

TEST(Intersect, DegenerateConfigurationsAreRefusedWithFigures) {
  const Eigen::Vector3d point(20, -35, 48);
  const auto one = observations_of(point, {0});
  EXPECT_EQ(intersect(one, white(one, 1)).error().reason, Reason::not_seen);
  const auto same = observations_of(point, {0.3, 0.3});
  EXPECT_EQ(intersect(same, white(same, 1)).error().reason, Reason::parallel_rays);
  const auto close = observations_of(point, {0, 0.01});
  EXPECT_LT(intersect(close, white(close, 1)).error().figures.at("angle_deg"), 1);

  // Two parallel sources with diverging rays: the lines intersect behind them.
  std::vector<RayObservation> apart{
      {{{6000, 6000, 512, 512, 0}, {Eigen::Matrix3d::Identity(), {50, 0, 800}}}, {-500, 512}},
      {{{6000, 6000, 512, 512, 0}, {Eigen::Matrix3d::Identity(), {-50, 0, 800}}}, {1500, 512}}};
  EXPECT_EQ(intersect(apart, white(apart, 1)).error().reason, Reason::behind_source);
}

}  // namespace
}  // namespace helicarm::geometry
