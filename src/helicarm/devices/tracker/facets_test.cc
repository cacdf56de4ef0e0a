// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/facets.h"

#include <numbers>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace facets_test {

constexpr double pi = std::numbers::pi;
constexpr double sigma_mm = 0.1;
constexpr double sigma_rad = 0.002;
constexpr FacetsOptions exact_body{0, 0};
const geometry::RigidTransform truth{geometry::rotation_from_vector({0.4, -1, 0.3}), {50, -80, 900}};

/// Four sides of a box 80 mm wide.
std::vector<Facet> four_facets() {
  std::vector<Facet> facets;
  for (int i = 0; i < 4; ++i) {
    const Eigen::Matrix3d turn = geometry::rotation_from_vector({0, 0, i * pi / 2});
    facets.push_back({"facet " + std::to_string(i), {turn, turn * Eigen::Vector3d(40, 0, 20)}});
  }
  return facets;
}

Eigen::Vector3d noise(RandomStream& random, double sigma) {
  return sigma * Eigen::Vector3d(random.normal(), random.normal(), random.normal());
}

FacetPose seen(const Facet& facet, RandomStream& random, double scale = 1) {
  const geometry::RigidTransform exact = truth * facet.calibrator_from_facet;
  FacetPose pose{facet.name, exact, PoseCovariance::Zero()};
  pose.covariance.diagonal().head<3>().setConstant(sigma_mm * sigma_mm);
  pose.covariance.diagonal().tail<3>().setConstant(sigma_rad * sigma_rad);
  pose.tracker_from_facet.rotation =
      geometry::rotation_from_vector(noise(random, scale * sigma_rad)) * exact.rotation;
  pose.tracker_from_facet.translation += noise(random, scale * sigma_mm);
  return pose;
}

Eigen::Matrix<double, 6, 1> error_of(const FusedPose& fused) {
  Eigen::Matrix<double, 6, 1> error;
  error << truth.translation - fused.tracker_from_calibrator.translation,
      geometry::vector_from_rotation(truth.rotation * fused.tracker_from_calibrator.rotation.transpose());
  return error;
}

TEST(Facets, AnyOneIsSufficient) {
  RandomStream random(1, 0);
  for (const Facet& facet : four_facets()) {
    const auto fused = fuse_facets(four_facets(), std::vector{seen(facet, random, 0)});
    ASSERT_TRUE(fused);
    EXPECT_LT(error_of(*fused).norm(), 1e-9);
    EXPECT_EQ(fused->used, std::vector{facet.name});
  }
}

TEST(Facets, CovarianceContainsTheTruth) {
  constexpr double chi2_6_at_95 = 12.5916;
  for (const std::size_t count : {1u, 2u, 4u}) {
    int inside = 0;
    for (int trial = 0; trial < 2000; ++trial) {
      RandomStream random(2, static_cast<std::uint32_t>(count), trial);
      std::vector<FacetPose> poses;
      for (std::size_t i = 0; i < count; ++i) poses.push_back(seen(four_facets()[i], random));
      const auto fused = fuse_facets(four_facets(), poses, exact_body);
      if (!fused) continue;
      const auto error = error_of(*fused);
      inside += error.dot(fused->covariance.inverse() * error) < chi2_6_at_95;
    }
    EXPECT_NEAR(inside / 2000.0, 0.95, 0.02) << count << " facets";
  }
}

TEST(Facets, MoreFacetsReduceTheError) {
  RandomStream random(3, 0);
  std::vector<FacetPose> poses;
  double last = 1e9;
  for (const Facet& facet : four_facets()) {
    poses.push_back(seen(facet, random));
    const double now = fuse_facets(four_facets(), poses)->covariance.topLeftCorner<3, 3>().trace();
    EXPECT_LT(now, last);
    last = now;
  }
}

TEST(Facets, InconsistentFacetIsRejected) {
  RandomStream random(4, 0);
  std::vector<FacetPose> poses;
  for (const Facet& facet : four_facets()) poses.push_back(seen(facet, random));
  poses[2].tracker_from_facet.translation.x() += 2;
  const auto fused = fuse_facets(four_facets(), poses);
  ASSERT_TRUE(fused);
  EXPECT_EQ(fused->thrown_out, std::vector<std::string>{"facet 2"});
  EXPECT_EQ(fused->used.size(), 3u);
}

TEST(Facets, TwoInconsistentFacetsAreRefused) {
  RandomStream random(5, 0);
  std::vector poses{seen(four_facets()[0], random), seen(four_facets()[1], random)};
  poses[1].tracker_from_facet.translation.x() += 2;
  EXPECT_EQ(fuse_facets(four_facets(), poses).error().reason, Reason::residual_too_large);
}

TEST(Facets, SwappedNamesAreRefused) {
  RandomStream random(6, 0);
  std::vector<FacetPose> poses;
  for (const Facet& facet : four_facets()) poses.push_back(seen(facet, random));
  std::swap(poses[0].name, poses[1].name);
  EXPECT_EQ(fuse_facets(four_facets(), poses).error().reason, Reason::residual_too_large);
}

TEST(Facets, NoUnknownOrDuplicateFacetIsAccepted) {
  RandomStream random(7, 0);
  const FacetPose pose = seen(four_facets()[0], random);
  FacetPose unknown = pose;
  unknown.name = "unknown";
  EXPECT_EQ(fuse_facets(four_facets(), {}).error().reason, Reason::no_pose);
  EXPECT_EQ(fuse_facets(four_facets(), std::vector{unknown}).error().reason, Reason::bad_value);
  EXPECT_EQ(fuse_facets(four_facets(), std::vector{pose, pose}).error().reason, Reason::name_clash);
}

}  // namespace facets_test
}  // namespace helicarm::tracker
