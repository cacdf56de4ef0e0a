// SPDX-License-Identifier: Apache-2.0
#include "gui/controller/hand_moves.h"

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::gui::hand_moves_test {
namespace {

geometry::View view_of(double fx) {
  geometry::View view;
  view.intrinsics = {fx, 2000, 500, 400, 3};
  view.camera_from_world.rotation = geometry::rotation_from_vector({0.3, -0.5, 0.2});
  view.camera_from_world.translation = {10, -20, 700};
  return view;
}

const Eigen::Vector3d centre(5, 8, -12);

TEST(HandMoves, AShiftMovesTheImageByTheDragAtTheSameDepth) {
  for (const double fx : {2000., -2000.}) {  // mirrored too
    const geometry::View view = view_of(fx);
    const Eigen::Vector2d from(480, 300), to(520, 330);
    const Eigen::Vector3d by = shift_in_view(view, centre, from, to);
    EXPECT_NEAR((view.project(centre + by) - view.project(centre) - (to - from)).norm(), 0, 1e-9);
    EXPECT_NEAR(view.depth(centre + by), view.depth(centre), 1e-9);
  }
}

TEST(HandMoves, ATurnTakesTheImageOfAPointBesideTheCentreToTheOtherPixel) {
  for (const double fx : {2000., -2000.}) {
    const geometry::View view = view_of(fx);
    const Eigen::Vector3d beside = centre + view.camera_from_world.rotation.transpose().col(0) * 0.01;
    const Eigen::Vector2d from = view.project(beside);
    const Eigen::Matrix3d quarter =
        geometry::rotation_from_vector(0.5 * EIGEN_PI * (centre - view.source_in_world()).normalized());
    const Eigen::Vector2d to = view.project(quarter * (beside - centre) + centre);
    const Eigen::Vector3d by = turn_in_view(view, centre, from, to);
    EXPECT_NEAR(by.norm(), 0.5 * EIGEN_PI, 1e-3);
    const Eigen::Matrix3d turn = geometry::rotation_from_vector(by);
    EXPECT_NEAR((view.project(turn * (beside - centre) + centre) - to).norm(), 0, 1e-3);
  }
  const geometry::View view = view_of(2000);
  EXPECT_TRUE(turn_in_view(view, centre, view.project(centre), {1, 1}).isZero());
}

TEST(HandMoves, StepsGoOnFromThePresentPose) {
  registration::RigidStep step;
  step << 0.2, -0.1, 0.3, 4, 5, 6;
  const geometry::RigidTransform pose{geometry::rotation_from_vector({1, 2, 0.5}), {7, 8, 9}};
  const geometry::RigidTransform there = registration::moved_about(pose, centre, step);
  const Eigen::Vector3d now = centre + step.tail<3>(), by(0.1, 0.4, -0.2);
  registration::RigidStep turn = registration::RigidStep::Zero();
  turn.head<3>() = by;
  EXPECT_TRUE(registration::moved_about(pose, centre, turned(step, by))
                  .matrix()
                  .isApprox(registration::moved_about(there, now, turn).matrix(), 1e-9));
  const geometry::RigidTransform shift = registration::moved_about(pose, centre, shifted(step, {1, 2, 3}));
  EXPECT_TRUE(shift.translation.isApprox(there.translation + Eigen::Vector3d(1, 2, 3), 1e-12));
}

}  // namespace
}  // namespace helicarm::gui::hand_moves_test
