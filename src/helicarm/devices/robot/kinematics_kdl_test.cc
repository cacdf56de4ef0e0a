// SPDX-License-Identifier: Apache-2.0
#include <numbers>

#include <gtest/gtest.h>
#include <kdl/chain.hpp>
#include <kdl/chainfksolverpos_recursive.hpp>
#include <kdl/chainjnttojacsolver.hpp>

#include "helicarm/core/random.h"
#include "helicarm/devices/robot/kinematics.h"

namespace helicarm::robot {
namespace kinematics_kdl_test {

constexpr double pi = std::numbers::pi;
constexpr double mm = 1e-3;  // KDL's lengths are metres here

KDL::Chain chain_of(const RobotModel& model) {
  // a, twist, d of each joint
  const double links[6][3] = {{0, pi / 2, model.d1}, {model.a2, 0, 0},       {model.a3, 0, 0},
                              {0, pi / 2, model.d4}, {0, -pi / 2, model.d5}, {0, 0, model.d6}};
  KDL::Chain chain;
  for (const auto& link : links)
    chain.addSegment(
        KDL::Segment(KDL::Joint(KDL::Joint::RotZ), KDL::Frame::DH(mm * link[0], link[1], mm * link[2], 0)));
  return chain;
}

class Judged : public testing::TestWithParam<RobotModel> {};

TEST_P(Judged, FlangeAndJacobianAreThoseOfKdl) {
  const KDL::Chain chain = chain_of(GetParam());
  KDL::ChainFkSolverPos_recursive forward(chain);
  KDL::ChainJntToJacSolver differential(chain);
  RandomStream random(11, 0);
  for (int trial = 0; trial < 200; ++trial) {
    Joints joints;
    KDL::JntArray angles(6);
    for (int i = 0; i < 6; ++i) joints[i] = angles(static_cast<unsigned>(i)) = random.uniform(-pi, pi);
    KDL::Frame frame;
    ASSERT_EQ(forward.JntToCart(angles, frame), 0);
    const geometry::RigidTransform flange = base_from_flange(GetParam(), joints);
    KDL::Jacobian rates(6);
    ASSERT_EQ(differential.JntToJac(angles, rates), 0);
    const Eigen::Matrix<double, 6, 6> ours = jacobian(GetParam(), joints);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(flange.translation[i], frame.p[i] / mm, 1e-9);
      for (int j = 0; j < 3; ++j) EXPECT_NEAR(flange.rotation(i, j), frame.M(i, j), 1e-12);
      for (int joint = 0; joint < 6; ++joint) {
        EXPECT_NEAR(ours(i, joint), rates.data(i, joint) / mm, 1e-9);
        EXPECT_NEAR(ours(3 + i, joint), rates.data(3 + i, joint), 1e-12);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Arms, Judged, testing::Values(ur5(), ur5e()),
                         [](const auto& arm) { return arm.param.name; });

}  // namespace kinematics_kdl_test
}  // namespace helicarm::robot
