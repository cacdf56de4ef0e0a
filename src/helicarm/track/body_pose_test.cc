// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/body_pose.h"

#include <random>

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/track/two_cameras_test.h"

namespace helicarm::track {
namespace body_pose_test {

const std::vector<Eigen::Vector3d> body{{10, 0, 3}, {-8, 7, -4}, {2, -9, 8}, {-5, -6, -9}};
const geometry::RigidTransform truth{geometry::rotation_from_vector({0.2, -0.1, 0.3}), {4, -3, 6}};

std::vector<SeenMarker> seen_by(const std::vector<geometry::View>& views, double sigma_px, double loose_mm,
                                std::mt19937& random) {
  std::normal_distribution<double> normal;
  std::vector<SeenMarker> seen;
  for (const Eigen::Vector3d& place : body) {
    const Eigen::Vector3d off(normal(random), normal(random), normal(random));
    SeenMarker marker{place, {}};
    for (const geometry::View& view : views)
      marker.sights.push_back({&view,
                               view.project(truth * place + loose_mm * off) +
                                   sigma_px * Eigen::Vector2d(normal(random), normal(random)),
                               sigma_px});
    seen.push_back(marker);
  }
  return seen;
}

TEST(BodyPose, CovarianceHoldsTheErrorsOfSeenMarkers) {
  const auto views = two_cameras();
  std::mt19937 random(3);
  int inside = 0, all = 0;
  for (int i = 0; i < 400; ++i) {
    auto seen = seen_by(views, 0.1, 0, random);
    seen[1].sights.pop_back();
    const auto fit = fit_pose({}, seen, std::nullopt, {});
    ASSERT_TRUE(fit);
    const RigidCovariance covariance = covariance_of(*fit, seen, 0);
    EXPECT_TRUE(covariance.isApprox(fit->covariance, 1e-6));
    const RigidStep off = registration::step_about(fit->world_from_body, truth, fit->centre);
    for (int k = 0; k < 6; ++k, ++all) inside += std::abs(off[k]) < 1.96 * std::sqrt(covariance(k, k));
  }
  EXPECT_NEAR(double(inside) / all, 0.95, 0.02);
}

TEST(BodyPose, HiddenMarkersDeviationIsInTheCovariance) {
  const auto views = two_cameras();
  std::mt19937 random(5);
  int inside = 0, all = 0;
  for (int i = 0; i < 400; ++i) {
    auto seen = seen_by(views, 0.02, 0.2, random);
    const auto whole = fit_pose({}, seen, std::nullopt, {.loose_mm = 0.2});
    seen[2].sights.clear();
    const auto fit = fit_pose({}, seen, std::nullopt, {.loose_mm = 0.2});
    ASSERT_TRUE(whole && fit);
    const RigidCovariance covariance = covariance_of(*fit, seen, 0.2);
    const RigidStep off = registration::step_about(fit->world_from_body, whole->world_from_body, fit->centre);
    for (int k = 0; k < 6; ++k, ++all) inside += std::abs(off[k]) < 1.96 * std::sqrt(covariance(k, k));
  }
  EXPECT_NEAR(double(inside) / all, 0.95, 0.02);
}

TEST(BodyPose, RobustFitLeavesAWrongMarkerOut) {
  const auto views = two_cameras();
  std::mt19937 random(7);
  auto seen = seen_by(views, 0.05, 0, random);
  for (Sight& sight : seen[3].sights) sight.uv += Eigen::Vector2d(8, -5);
  const auto fit = fit_pose(truth, seen, std::nullopt, {.robust = true});
  ASSERT_TRUE(fit);
  EXPECT_EQ(fit->weight[3], 0);
  EXPECT_LT((fit->world_from_body * body[3] - truth * body[3]).norm(), 0.3);
}

TEST(BodyPose, CollinearMarkersHaveNoSecondExtent) {
  const std::vector<Eigen::Vector3d> line{{0, 0, 0}, {5, 5, 0}, {10, 10, 0}};
  EXPECT_LT(extents(line)[1], 1e-9);
  EXPECT_GT(extents(body)[1], 5);
}

}  // namespace body_pose_test
}  // namespace helicarm::track
