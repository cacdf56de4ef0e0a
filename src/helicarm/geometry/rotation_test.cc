// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/rotation.h"

#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"

namespace helicarm::geometry {
namespace {

constexpr double pi = std::numbers::pi;

Eigen::Vector3d random_vector(RandomStream& random, double length) {
  return length * Eigen::Vector3d(random.normal(), random.normal(), random.normal()).normalized();
}

void expect_rotation(const Eigen::Matrix3d& r) {
  EXPECT_LT((r.transpose() * r - Eigen::Matrix3d::Identity()).norm(), 1e-14);
  EXPECT_GT(r.determinant(), 0);
}

TEST(Euler, CorrectedEquationFiveIsARotationForAllAngles) {
  RandomStream random(1, 0);
  for (int i = 0; i < 200; ++i)
    expect_rotation(
        rotation_from_euler(random.uniform(-pi, pi), random.uniform(-pi, pi), random.uniform(-pi, pi)));
}

TEST(Euler, EulerAnglesRoundTrip) {
  RandomStream random(2, 0);
  for (int i = 0; i < 200; ++i) {
    const double alpha = random.uniform(-pi, pi), beta = random.uniform(-1.5, 1.5),
                 gamma = random.uniform(-pi, pi);
    const EulerAngles angles = euler_from_rotation(rotation_from_euler(alpha, beta, gamma));
    EXPECT_NEAR(angles.alpha, alpha, 1e-13);
    EXPECT_NEAR(angles.beta, beta, 1e-13);
    EXPECT_NEAR(angles.gamma, gamma, 1e-13);
    EXPECT_FALSE(angles.gimbal_locked);
  }
}

TEST(Euler, GimbalLockIsFlaggedAndKeepsTheRotation) {
  for (double beta : {pi / 2, -pi / 2}) {
    const Eigen::Matrix3d rotation = rotation_from_euler(0.4, beta, 1.1);
    const EulerAngles angles = euler_from_rotation(rotation);
    EXPECT_TRUE(angles.gimbal_locked);
    EXPECT_EQ(angles.gamma, 0);
    EXPECT_LT((rotation_from_euler(angles.alpha, angles.beta, 0) - rotation).norm(), 1e-12);
  }
}

TEST(RotationVector, RoundTripsUpToHalfATurn) {
  RandomStream random(3, 0);
  for (double angle : {0.0, 1e-12, 1e-7, 0.3, 2.0, pi - 1e-9}) {
    const Eigen::Vector3d vector = random_vector(random, angle);
    const Eigen::Matrix3d rotation = rotation_from_vector(vector);
    expect_rotation(rotation);
    EXPECT_LT((vector_from_rotation(rotation) - vector).norm(), 1e-12 * (1 + angle));
  }
}

TEST(RotationVector, HalfTurnKeepsItsAxis) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 0.5).normalized();
  const Eigen::Vector3d back = vector_from_rotation(rotation_from_vector(pi * axis));
  EXPECT_LT((rotation_from_vector(back) - rotation_from_vector(pi * axis)).norm(), 1e-12);
  EXPECT_NEAR(back.norm(), pi, 1e-12);
}

TEST(RotationVector, FirstOrderIsTheCrossMatrix) {
  const Eigen::Vector3d small(1e-6, -2e-6, 3e-6);
  EXPECT_LT((rotation_from_vector(small) - Eigen::Matrix3d::Identity() - cross_matrix(small)).norm(), 2e-11);
}

TEST(RotationBetween, TurnsOneDirectionIntoTheOtherAboutWhatIsAcrossBoth) {
  RandomStream random(8, 0);
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d from = random_vector(random, 3), to = random_vector(random, 0.2);
    const Eigen::Matrix3d rotation = rotation_between(from, to);
    expect_rotation(rotation);
    EXPECT_LT((rotation * from.normalized() - to.normalized()).norm(), 1e-12);
    EXPECT_LT((rotation * from.cross(to) - from.cross(to)).norm(), 1e-12);
  }
}

TEST(RotationBetween, OfOneDirectionIsNoneAndOfOppositeOnesHalfATurn) {
  const Eigen::Vector3d from(1, -2, 0.5);
  EXPECT_LT((rotation_between(from, 3 * from) - Eigen::Matrix3d::Identity()).norm(), 1e-12);
  for (const double aside : {0.0, 1e-12, 1e-8, 1e-5}) {
    const Eigen::Vector3d to = -from.normalized() + aside * Eigen::Vector3d(2, 1, 0).normalized();
    const Eigen::Matrix3d rotation = rotation_between(from, to);
    expect_rotation(rotation);
    EXPECT_LT((rotation * from.normalized() - to.normalized()).norm(), 1e-6);
  }
}

Eigen::Matrix4d some_pose() {
  return RigidTransform{rotation_from_euler(0.3, -0.4, 2), Eigen::Vector3d(10, -20, 800)}.matrix();
}

TEST(RigidTransformFrom, RoundingIsCorrected) {
  Eigen::Matrix4d rounded = some_pose();
  rounded = (rounded * 1e4).array().round() / 1e4;
  const auto pose = rigid_transform_from(rounded, "pose");
  ASSERT_TRUE(pose.has_value());
  expect_rotation(pose->rotation);
  EXPECT_EQ(pose->translation, Eigen::Vector3d(10, -20, 800));
}

TEST(RigidTransformFrom, ScaleReflectionLastRowZeroAndNanAreRefused) {
  Eigen::Matrix4d scaled = some_pose(), mirrored = some_pose(), affine = some_pose(), broken = some_pose();
  scaled.topLeftCorner<3, 3>() *= 1.01;
  mirrored.row(0) *= -1;
  affine(3, 1) = 0.5;
  broken(1, 2) = std::nan("");
  EXPECT_EQ(rigid_transform_from(scaled, "x").error().reason, Reason::bad_value);
  EXPECT_EQ(rigid_transform_from(mirrored, "x").error().reason, Reason::bad_value);
  EXPECT_EQ(rigid_transform_from(affine, "x").error().reason, Reason::bad_value);
  EXPECT_EQ(rigid_transform_from(Eigen::Matrix4d::Zero(), "x").error().reason, Reason::bad_value);
  EXPECT_EQ(rigid_transform_from(broken, "x").error().reason, Reason::not_finite);
}

}  // namespace
}  // namespace helicarm::geometry
