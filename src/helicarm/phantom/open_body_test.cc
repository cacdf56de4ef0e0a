// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/open_body.h"

#include <numeric>

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace helicarm::phantom {
namespace {

/// Balls in a box, on no cone.
Calibrator scattered() {
  Calibrator calibrator{"scattered", {}, {}};
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(100, 20, 0),
                                   {70, 45, 12},
                                   {60, 0, 25},
                                   {90, -15, 33},
                                   {75, 15, 41},
                                   {110, 40, 50},
                                   {60, 30, 55}})
    calibrator.balls.push_back({fmt::format("B{}", calibrator.balls.size() + 1), p, 4});
  return calibrator;
}

/// Number of connected parts of a closed surface.
std::size_t parts(const TriangleMesh& mesh) {
  std::vector<std::uint32_t> root(mesh.corners.size());
  std::iota(root.begin(), root.end(), 0u);
  const auto find = [&](std::uint32_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  for (const auto& triangle : mesh.triangles)
    for (const int k : {1, 2}) root[find(triangle[std::size_t(k)])] = find(triangle[0]);
  std::size_t count = 0;
  for (std::uint32_t i = 0; i < root.size(); ++i) count += find(i) == i;
  return count;
}

class OpenBody : public testing::TestWithParam<BodyShape> {};

TEST_P(OpenBody, IsOnePartWithAPocketForEachBall) {
  const Calibrator calibrator = scattered();
  BodyOptions options{.shape = GetParam(), .clearance_mm = 0.2};
  const auto mesh = printable_body(calibrator, options);
  ASSERT_TRUE(mesh) << mesh.error().message;
  EXPECT_EQ(parts(*mesh), 1u);
  const SignedDistance distance = body_distance(calibrator, options);
  for (const CalibratorBall& ball : calibrator.balls) {
    EXPECT_NEAR(distance(ball.centre_in_calibrator), 2.1, 1e-9) << ball.label;
    const Eigen::Vector3d below = ball.centre_in_calibrator - Eigen::Vector3d(0, 0, 2.1 + 1);
    EXPECT_LT(distance(below), 0) << ball.label;
  }
}

TEST_P(OpenBody, LeavesTheBoxFree) {
  const BodyOptions options{.shape = GetParam()};
  const Eigen::AlignedBox3d box = open_body_box(scattered(), options);
  const SignedDistance distance = body_distance(scattered(), options);
  for (int i = 0; i <= 20; ++i)
    for (int j = 0; j <= 20; ++j)
      for (int face = 0; face < 6; ++face) {
        Eigen::Vector3d share(i / 20.0, j / 20.0, face % 2);
        std::swap(share[2], share[face / 2]);
        EXPECT_GE(distance(box.min() + share.cwiseProduct(box.sizes())), options.step_mm);
      }
}

INSTANTIATE_TEST_SUITE_P(Shapes, OpenBody, testing::Values(BodyShape::rings, BodyShape::plate));

TEST(BodyShapeOf, BallsOnTheConeIsACone) { EXPECT_EQ(suitable_shape(udcsc()), BodyShape::cone); }

TEST(BodyShapeOf, ScatteredBallsIsOfRings) { EXPECT_EQ(suitable_shape(scattered()), BodyShape::rings); }

TEST(PrintableBody, BallUnderAnotherHasNoPost) {
  Calibrator calibrator = scattered();
  calibrator.balls.push_back(
      {"under", calibrator.balls[6].centre_in_calibrator - Eigen::Vector3d(1, 0, 20), 4});
  const auto mesh = printable_body(calibrator, {.shape = BodyShape::plate});
  ASSERT_FALSE(mesh);
  EXPECT_EQ(mesh.error().reason, Reason::bad_value);
  EXPECT_NE(mesh.error().message.find("under"), std::string::npos);
  EXPECT_TRUE(printable_body(calibrator, {.shape = BodyShape::rings}));
}

TEST(PrintableBody, ClearanceHasLimits) {
  EXPECT_EQ(printable_body(udcsc(), {.clearance_mm = -1}).error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::phantom
