// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/joint_angles.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/track/track_case.h"

namespace helicarm::track {
namespace joint_angles_test {

TrackedBody turned(const Eigen::Matrix3d& rotation, double sigma_rad = 0) {
  TrackedBody body;
  body.pose = FramePose{{rotation, {3, -2, 8}}, registration::RigidCovariance::Zero()};
  body.pose->covariance.topLeftCorner<3, 3>().diagonal().setConstant(sigma_rad * sigma_rad);
  return body;
}

/// By the definition of the axes: floating axis e2 = k x I.
Eigen::Vector3d by_the_axes(const Eigen::Matrix3d& reference, const Eigen::Matrix3d& body) {
  const Eigen::Vector3d I = reference.col(0), J = reference.col(1), K = reference.col(2);
  const Eigen::Vector3d i = body.col(0), j = body.col(1), k = body.col(2);
  const Eigen::Vector3d e2 = k.cross(I).normalized();
  return {std::atan2(-e2.dot(K), e2.dot(J)), std::asin(I.dot(k)), std::atan2(-e2.dot(i), e2.dot(j))};
}

Eigen::Matrix3d any_axes(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return geometry::rotation_from_vector({normal(random), normal(random), normal(random)});
}

TEST(JointAngles, FlexedKneeTurnsItsShankBackwards) {
  // x right, y anterior, z proximal: the shank's distal end goes from -z towards -y.
  const Eigen::Matrix3d bent = geometry::rotation_from_vector({-0.5, 0, 0});
  EXPECT_LT((bent * Eigen::Vector3d(0, 0, -1)).y(), 0);
  const auto angles = joint_angles(turned(Eigen::Matrix3d::Identity()), Eigen::Matrix3d::Identity(),
                                   turned(bent), Eigen::Matrix3d::Identity());
  ASSERT_TRUE(angles);
  EXPECT_TRUE(angles->angles.isApprox(Eigen::Vector3d(0.5, 0, 0)));
}

TEST(JointAngles, AreThoseBetweenTheAxes) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Matrix3d reference = any_axes(random), body = any_axes(random), first = any_axes(random),
                          second = any_axes(random);
    const auto angles = joint_angles(turned(first), reference, turned(second), body);
    const Eigen::Vector3d expected = by_the_axes(first * reference, second * body);
    if (std::abs(expected[1]) > 1.4) continue;
    ASSERT_TRUE(angles);
    EXPECT_LT((angles->angles - expected).norm(), 1e-9);
  }
}

TEST(JointAngles, CovarianceIsTheScatterOfNoisyPoses) {
  constexpr double sigma = 0.01;
  constexpr int trials = 4000;
  std::mt19937 random(8);
  std::normal_distribution<double> normal(0, sigma);
  const Eigen::Matrix3d axes = any_axes(random),
                        other = axes * geometry::rotation_from_vector({0.7, 0.6, -0.3});
  const auto stated = joint_angles(turned(Eigen::Matrix3d::Identity(), sigma), axes,
                                   turned(Eigen::Matrix3d::Identity(), sigma), other);
  ASSERT_TRUE(stated);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  const auto noise = [&] {
    return geometry::rotation_from_vector({normal(random), normal(random), normal(random)});
  };
  for (int trial = 0; trial < trials; ++trial) {
    const auto drawn = joint_angles(turned(noise()), axes, turned(noise()), other);
    const Eigen::Vector3d off = drawn->angles - stated->angles;
    scatter += off * off.transpose() / trials;
  }
  EXPECT_LT((scatter - stated->covariance).norm(), 0.1 * stated->covariance.norm());
}

TEST(JointAngles, UndefinedFloatingAxisHasNone) {
  const Eigen::Matrix3d flat = geometry::rotation_from_vector({0, EIGEN_PI / 2, 0}),
                        none = Eigen::Matrix3d::Identity();
  EXPECT_FALSE(joint_angles(turned(none), none, turned(flat), none));
  EXPECT_FALSE(joint_angles(turned(none), none, {}, none));
}

class BodyAxesFile : public testing::Test {
 protected:
  Expected<std::vector<BodyAxes>> read(const std::string& rows) {
    TrackCase the_case;
    the_case.bodies = {{"femur", {}, {}}, {"tibia", {}, {}}};
    EXPECT_TRUE(write_file(folder_.path() / "axes.csv", "body,axis,x,y,z\n" + rows));
    return read_body_axes(folder_.path() / "axes.csv", the_case);
  }
  const std::string tibia = "tibia,x,1,0,0\ntibia,y,0,1,0\ntibia,z,0,0,1\n";
  TemporaryFolder folder_;
};

TEST_F(BodyAxesFile, FirstBodyIsTheReference) {
  const auto axes = read(tibia + "femur,z,1,0,0\nfemur,y,0,0,1\nfemur,x,0,1,0\n");
  ASSERT_TRUE(axes);
  EXPECT_EQ(axes->front().body, 1U);
  EXPECT_EQ(axes->back().axes.col(2), Eigen::Vector3d(1, 0, 0));
}

TEST_F(BodyAxesFile, WrongAxesAreNamed) {
  const auto message = [&](const std::string& rows) {
    const auto axes = read(rows);
    return axes ? "" : axes.error().message;
  };
  EXPECT_EQ(message(tibia), "axes.csv: axes of 1 body, a joint has two");
  EXPECT_EQ(message(tibia + "tibia,x,1,0,0\n"), "axes.csv: axis x of \"tibia\" is given twice");
  EXPECT_EQ(message(tibia + "femur,x,1,0,0\n"), "axes.csv: axes of \"femur\" are missing: x, y and z");
  EXPECT_EQ(message("patella,x,1,0,0\n"), "axes.csv: \"patella\" is no body of the case");
  EXPECT_EQ(message(tibia + "femur,w,1,0,0\n"), "axes.csv: axis \"w\" is none of x, y, z");
  EXPECT_NE(message(tibia + "femur,x,1,0,0\nfemur,y,0,1,0\nfemur,z,0,0,-1\n").find("no right-handed"),
            std::string::npos);
}

}  // namespace joint_angles_test
}  // namespace helicarm::track
