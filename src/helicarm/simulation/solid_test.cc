// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/solid.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::simulation {
namespace {

using Eigen::Vector3d;

double chord(const Solid& solid, const Vector3d& source, const Vector3d& direction) {
  const Interval part = solid.intersect(source, direction);
  return (part.leave - part.enter) * direction.norm();
}

TEST(Solid, BallChordIsTheClosedFormAtAnyImpactParameter) {
  const Solid ball = sphere({3, -2, 650}, 2);
  for (double miss : {0.0, 0.5, 1.0, 1.9, 1.999, 2.0, 2.1})
    EXPECT_NEAR(chord(ball, {3 + miss, -2, 0}, {0, 0, 0.3}), 2 * std::sqrt(std::max(0.0, 4 - miss * miss)),
                1e-9);
}

TEST(Solid, ObliqueCylinderChordIsItsDiameterOverTheSine) {
  const Solid wire = cylinder({-50, 0, 0}, {50, 0, 0}, 1);
  const double angle = 0.4;
  EXPECT_NEAR(
      chord(wire, {-600 * std::cos(angle), 0, -600 * std::sin(angle)}, {std::cos(angle), 0, std::sin(angle)}),
      2 / std::sin(angle), 1e-10);
  EXPECT_NEAR(chord(wire, {-700, 0.5, 0}, {1, 0, 0}), 100, 1e-10);
  EXPECT_EQ(chord(wire, {-700, 1.5, 0}, {1, 0, 0}), 0);
}

TEST(Solid, FrustumAgreesAlongAcrossAndSteeperThanItsWall) {
  const Solid cone = frustum({0, 0, 0}, {0, 0, 80}, 60, 30);
  EXPECT_NEAR(chord(cone, {-500, 0, 40}, {1, 0, 0}), 90, 1e-9);
  EXPECT_NEAR(chord(cone, {10, 0, -500}, {0, 0, 1}), 80, 1e-9);
  EXPECT_NEAR(chord(cone, {45, 0, -500}, {0, 0, 1}), 40, 1e-9);
  EXPECT_NEAR(chord(cone, {45, 0, 500}, {0, 0, -1}), 40, 1e-9);
}

TEST(Solid, EveryKindAgreesWithSampling) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  const std::vector<Solid> solids = {ellipsoid({1, 2, 3}, {9, 5, 7}, turn), box({1, 2, 3}, {4, 5, 6}, turn),
                                     flat_frustum({-5, 0, 2}, {6, 3, 9}, 7, 3, {0, 0, 1}, 0.6)};
  const auto inside = [](const Solid& solid, const Vector3d& point) {
    const Vector3d p = solid.unit_from_world * point;
    if (solid.kind == Solid::Kind::ball) return p.norm() <= 1;
    if (solid.kind == Solid::Kind::box) return p.cwiseAbs().maxCoeff() <= 1;
    return p.z() >= 0 && p.z() <= 1 && p.head<2>().norm() <= 1 + (solid.taper - 1) * p.z();
  };
  RandomStream random(5, 0);
  for (int trial = 0; trial < 30; ++trial) {
    const Vector3d source(random.uniform(-40, 40), random.uniform(-40, 40), -40);
    const Vector3d aim(random.uniform(-6, 8), random.uniform(-4, 8), random.uniform(-2, 9));
    const Vector3d direction = (aim - source).normalized();
    constexpr double step = 0.002;
    double any = 0;
    std::vector<double> counted(solids.size());
    for (double t = 0; t < 100; t += step) {
      bool hit = false;
      for (std::size_t i = 0; i < solids.size(); ++i)
        if (inside(solids[i], source + t * direction)) {
          counted[i] += step;
          hit = true;
        }
      any += hit * step;
    }
    for (std::size_t i = 0; i < solids.size(); ++i)
      EXPECT_NEAR(chord(solids[i], source, direction), counted[i], 2 * step);
    EXPECT_NEAR(union_length(solids, source, direction), any, 4 * step);
  }
}

TEST(Solid, InvariantToACommonMotionOfSolidAndRay) {
  const geometry::RigidTransform move{
      Eigen::AngleAxisd(1.1, Vector3d(2, -1, 1).normalized()).toRotationMatrix(), {5, 6, -7}};
  const Solid cone = frustum({0, 0, 0}, {0, 10, 80}, 6, 3);
  const Vector3d source(-200, 20, 3);
  const Vector3d direction(1, -0.07, 0.1);
  EXPECT_GT(chord(cone, source, direction), 1);
  EXPECT_NEAR(chord(moved(cone, move), move * source, move.rotation * direction),
              chord(cone, source, direction), 1e-9);
}

TEST(Solid, SignedDistanceOfABallABoxAndAConeWall) {
  EXPECT_NEAR(signed_distance(sphere({3, -2, 5}, 4), {3, 5, 5}), 3, 1e-12);
  EXPECT_NEAR(signed_distance(sphere({3, -2, 5}, 4), {3, -2, 5}), -4, 1e-12);
  EXPECT_NEAR(signed_distance(box({0, 0, 0}, {1, 2, 3}), {0, 1.5, 0}), -0.5, 1e-12);
  const Solid cone = frustum({0, 0, 0}, {0, 0, 80}, 60, 30);
  EXPECT_NEAR(signed_distance(cone, {0, 55, 40}), 10 / std::hypot(1, 30.0 / 80), 1e-12);
  EXPECT_NEAR(signed_distance(cone, {1, 0, 83}), 3, 1e-12);
}

TEST(Solid, SignedDistanceIsNegativeExactlyInside) {
  RandomStream random(3, 1);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  for (const Solid& solid :
       {ellipsoid({4, 0, 2}, {12, 30, 21}, turn), flat_frustum({0, 5, 0}, {20, 0, 40}, 25, 9, {0, 0, 1}, 0.6),
        box({1, 2, 3}, {20, 10, 15}, turn)})
    for (int trial = 0; trial < 500; ++trial) {
      const Vector3d point =
          60 * Vector3d(random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.3);
      const Interval part = solid.intersect(point, Vector3d(1, 0.2, -0.3));
      const bool inside = part.enter < 0 && part.leave > 0;
      EXPECT_EQ(signed_distance(solid, point) < 0, inside) << point.transpose();
    }
}

TEST(Solid, SignedDistanceHasUnitSlopeAtTheSurface) {
  const Solid egg = ellipsoid({0, 0, 0}, {12, 30, 21});
  const Vector3d on = Vector3d(12 * 0.6, 0, 21 * 0.8);
  const Vector3d normal = Vector3d(0.6 / 12, 0, 0.8 / 21).normalized();
  EXPECT_NEAR(signed_distance(egg, on), 0, 1e-12);
  EXPECT_NEAR(signed_distance(egg, on + 0.1 * normal), 0.1, 0.001);
}

}  // namespace
}  // namespace helicarm::simulation
