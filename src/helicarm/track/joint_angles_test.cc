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
  const BodyAxes axes{0, Eigen::Matrix3d::Identity()};
  const auto angles = joint_angles(turned(Eigen::Matrix3d::Identity()), axes, turned(bent), axes);
  ASSERT_TRUE(angles);
  EXPECT_TRUE(angles->angles.isApprox(Eigen::Vector3d(0.5, 0, 0)));
}

TEST(JointAngles, AreThoseBetweenTheAxes) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 50; ++trial) {
    const Eigen::Matrix3d reference = any_axes(random), body = any_axes(random), first = any_axes(random),
                          second = any_axes(random);
    const auto angles =
        joint_angles(turned(first), BodyAxes{0, reference}, turned(second), BodyAxes{1, body});
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
  const BodyAxes axes{0, any_axes(random)},
      other{1, axes.axes * geometry::rotation_from_vector({0.7, 0.6, -0.3})};
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

TEST(JointAngles, ShiftsAreAlongTheJointsAxes) {
  // The shank, bent by 90 degrees: its origin 5 mm to the right, 7 mm anterior of and 20 mm below the
  // reference's.
  const Eigen::Matrix3d none = Eigen::Matrix3d::Identity(),
                        bent = geometry::rotation_from_vector({-EIGEN_PI / 2, 0, 0});
  const BodyAxes thigh{0, none, Eigen::Vector3d::Zero()},
      shank{1, none, bent.transpose() * Eigen::Vector3d(5, 7, -20)};
  const auto joint = joint_angles(turned(none), thigh, turned(bent), shank);
  ASSERT_TRUE(joint && joint->shift);
  // The floating axis of a shank that points backwards is distal, its z anterior.
  EXPECT_LT((*joint->shift - Eigen::Vector3d(5, 20, -7)).norm(), 1e-9);
  EXPECT_FALSE(joint_angles(turned(none), {0, none}, turned(bent), shank)->shift);
}

TEST(JointAngles, CovarianceOfShiftsIsTheScatterOfNoisyPoses) {
  constexpr double turn = 0.004, place = 0.2;
  constexpr int trials = 4000;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto noise = [&](double sigma) {
    return Eigen::Vector3d(sigma * normal(random), sigma * normal(random), sigma * normal(random));
  };
  const BodyAxes thigh{0, any_axes(random), noise(40)},
      shank{1, thigh.axes * geometry::rotation_from_vector({0.7, 0.6, -0.3}), noise(40)};
  const auto body = [&](const Eigen::Vector3d& off, const Eigen::Vector3d& shift) {
    TrackedBody made = turned(geometry::rotation_from_vector(off), turn);
    made.centre = Eigen::Vector3d(10, -30, 5);
    made.pose->pose.translation = made.centre - made.pose->pose.rotation * made.centre + shift;
    made.pose->covariance.bottomRightCorner<3, 3>().diagonal().setConstant(place * place);
    return made;
  };
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  const auto stated = joint_angles(body(zero, zero), thigh, body(zero, zero), shank);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (int trial = 0; trial < trials; ++trial) {
    const auto drawn =
        joint_angles(body(noise(turn), noise(place)), thigh, body(noise(turn), noise(place)), shank);
    const Eigen::Vector3d off = *drawn->shift - *stated->shift;
    scatter += off * off.transpose() / trials;
  }
  EXPECT_LT((scatter - stated->shift_covariance).norm(), 0.1 * stated->shift_covariance.norm());
}

TEST(JointAngles, UndefinedFloatingAxisHasNone) {
  const Eigen::Matrix3d flat = geometry::rotation_from_vector({0, EIGEN_PI / 2, 0}),
                        none = Eigen::Matrix3d::Identity();
  const BodyAxes axes{0, none};
  EXPECT_FALSE(joint_angles(turned(none), axes, turned(flat), axes));
  EXPECT_FALSE(joint_angles(turned(none), axes, {}, axes));
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
  EXPECT_EQ(message(tibia + "femur,w,1,0,0\n"), "axes.csv: axis \"w\" is none of x, y, z, origin");
  EXPECT_EQ(message(tibia + "femur,x,1,0,0\nfemur,y,0,1,0\nfemur,z,0,0,-1\n"),
            "axes.csv: the axes of \"femur\" are left-handed: z is the cross product of x and y");
  EXPECT_EQ(
      message(tibia + "femur,x,1,0,0\nfemur,y,0.1,1,0\nfemur,z,0,0,1\n"),
      "axes.csv: the axes of \"femur\" are no perpendicular unit vectors: they are off by 0.1, limit 0.001");
}

TEST_F(BodyAxesFile, MarkupsOfSlicerGiveAxesAndOrigins) {
  TrackCase the_case;
  the_case.bodies = {{"femur", {}, {}}, {"tibia", {}, {}}};
  const auto read = [&](const std::string& rows) {
    EXPECT_TRUE(write_file(folder_.path() / "axes.fcsv",
                           "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n"
                           "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n" +
                               rows));
    return read_body_axes(folder_.path() / "axes.fcsv", the_case);
  };
  const auto point = [](const std::string& name, const std::string& xyz) {
    return "1," + xyz + ",0,0,0,1,1,1,0," + name + ",,\n";
  };
  const std::string femur =
      point("femur_origin", "10,0,0") + point("femur_z", "10,0,50") + point("femur_x", "40,0,7");
  const auto axes =
      read(femur + point("tibia_origin", "0,0,0") + point("tibia_x", "0,3,0") + point("tibia_z", "9,0,0"));
  ASSERT_TRUE(axes) << axes.error().message;
  EXPECT_TRUE(axes->front().axes.isApprox(Eigen::Matrix3d::Identity()));
  EXPECT_EQ(axes->front().origin, Eigen::Vector3d(10, 0, 0));
  EXPECT_EQ(axes->back().axes.col(1), Eigen::Vector3d(0, 0, 1));
  EXPECT_EQ(read(femur + point("tibia_z", "0,0,1")).error().message,
            "axes.fcsv: the point \"tibia_origin\" is missing");
  EXPECT_NE(read(point("hip_x", "1,2,3")).error().message.find("\"hip_x\" is none of"), std::string::npos);
  EXPECT_NE(read(point("femur_origin", "0,0,0") + point("femur_z", "0,0,9") + point("femur_x", "0,0,5"))
                .error()
                .message.find("on one line"),
            std::string::npos);
}

}  // namespace joint_angles_test
}  // namespace helicarm::track
