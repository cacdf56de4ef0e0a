// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/kinematics.h"

#include <numbers>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::robot {
namespace {

constexpr double pi = std::numbers::pi;

Joints random_joints(RandomStream& random) {
  Joints joints;
  for (int i = 0; i < 6; ++i) joints[i] = random.uniform(-pi, pi);
  return joints;
}

/// Reference: product of four elementary motions per joint, for any twists.
geometry::RigidTransform plain_product(const std::array<std::array<double, 3>, 6>& d_a_twist,
                                       const Joints& joints) {
  Eigen::Affine3d product = Eigen::Affine3d::Identity();
  for (int i = 0; i < 6; ++i) {
    product.rotate(Eigen::AngleAxisd(joints[i], Eigen::Vector3d::UnitZ()));
    product.translate(Eigen::Vector3d(d_a_twist[i][1], 0, d_a_twist[i][0]));
    product.rotate(Eigen::AngleAxisd(d_a_twist[i][2], Eigen::Vector3d::UnitX()));
  }
  return {product.linear(), product.translation()};
}

double difference(const geometry::RigidTransform& a, const geometry::RigidTransform& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

TEST(Kinematics, ForwardAgreesWithTheElementaryProduct) {
  RandomStream random(1, 0);
  for (int trial = 0; trial < 100; ++trial) {
    const Joints joints = random_joints(random);
    EXPECT_LT(difference(base_from_flange(ur5(), joints), plain_product({{{89.159, 0, pi / 2},
                                                                          {0, -425, 0},
                                                                          {0, -392.25, 0},
                                                                          {109.15, 0, pi / 2},
                                                                          {94.65, 0, -pi / 2},
                                                                          {82.3, 0, 0}}},
                                                                        joints)),
              1e-10);
  }
}

TEST(Kinematics, StretchedArmReachesAlongMinusX) {
  const geometry::RigidTransform flange = base_from_flange(ur5e(), Joints::Zero());
  EXPECT_TRUE(flange.translation.isApprox(Eigen::Vector3d(-817.2, -133.3 - 99.6, 162.5 - 99.7), 1e-12));
}

TEST(Kinematics, EveryInverseReachesThePoseAndOneIsTheOriginal) {
  RandomStream random(2, 0);
  int most = 0;
  for (const RobotModel& model : {ur5(), ur5e()})
    for (int trial = 0; trial < 2000; ++trial) {
      const Joints joints = random_joints(random);
      const geometry::RigidTransform pose = base_from_flange(model, joints);
      const auto solutions = inverse(model, pose);
      for (const Joints& solution : solutions)
        EXPECT_LT(difference(base_from_flange(model, solution), pose), 1e-9);
      most = std::max(most, static_cast<int>(solutions.size()));
      const auto nearest = nearest_inverse(model, pose, joints);
      ASSERT_TRUE(nearest);
      if (least_singular_value(model, joints) > 1e-3) {
        EXPECT_LT((*nearest - joints).norm(), 1e-6) << joints.transpose();
      }
    }
  EXPECT_EQ(most, 8);
}

TEST(Kinematics, JacobianAgreesWithDifferences) {
  RandomStream random(3, 0);
  const Eigen::Vector3d tip(10, -20, 150);
  for (int trial = 0; trial < 20; ++trial) {
    const Joints joints = random_joints(random);
    const auto columns = jacobian(ur5(), joints, tip);
    for (int i = 0; i < 6; ++i) {
      constexpr double h = 1e-6;
      Joints low = joints, high = joints;
      low[i] -= h, high[i] += h;
      const geometry::RigidTransform a = base_from_flange(ur5(), low), b = base_from_flange(ur5(), high);
      EXPECT_LT((columns.col(i).head<3>() - (b * tip - a * tip) / (2 * h)).norm(), 1e-5);
      const Eigen::Vector3d turn =
          geometry::vector_from_rotation(b.rotation * a.rotation.transpose()) / (2 * h);
      EXPECT_LT((columns.col(i).tail<3>() - turn).norm(), 1e-8);
    }
  }
}

TEST(Kinematics, NearestUsesWholeTurnsWithinTheLimits) {
  Joints joints;
  joints << 1.5 * pi, -1.2, 1.1, -1.4, -1.5, -1.6 * pi;
  const auto found = nearest_inverse(ur5(), base_from_flange(ur5(), joints), joints);
  ASSERT_TRUE(found);
  EXPECT_LT((*found - joints).norm(), 1e-9);
  joints[2] = 1.2 * pi;  // beyond the elbow's limit
  const auto other = nearest_inverse(ur5(), base_from_flange(ur5(), joints), joints);
  EXPECT_TRUE(!other || std::abs((*other)[2]) <= pi);
}

TEST(Kinematics, PositionOutOfReachHasNoInverse) {
  geometry::RigidTransform far;
  far.translation = {1200, 0, 200};
  EXPECT_TRUE(inverse(ur5(), far).empty());
  EXPECT_EQ(nearest_inverse(ur5(), far, Joints::Zero()).error().reason, Reason::out_of_reach);
  far.translation = {0, 0, 500};  // inside the cylinder about the base that the wrist cannot enter
  EXPECT_TRUE(inverse(ur5(), far).empty());
  far.translation.x() = std::nan("");
  EXPECT_TRUE(inverse(ur5(), far).empty());
}

TEST(Kinematics, SingularPosesAreDetected) {
  Joints joints;
  joints << 0.3, -1.2, 1.4, -1.7, -1.5, 0.2;
  EXPECT_GT(least_singular_value(ur5(), joints), 0.05);
  Joints stretched = joints, wrist = joints;
  stretched[2] = 0;
  wrist[4] = 0;
  EXPECT_LT(least_singular_value(ur5(), stretched), 1e-7);
  EXPECT_LT(least_singular_value(ur5(), wrist), 1e-7);
}

}  // namespace
}  // namespace helicarm::robot
