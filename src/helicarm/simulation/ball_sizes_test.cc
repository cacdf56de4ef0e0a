// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/ball_sizes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::simulation {
namespace {

using testing::HasSubstr, testing::IsEmpty;

/// One view of one ball, `f_px` for a source distance of 1000 mm.
SimulatedCase seen_with(double f_px, double diameter_mm) {
  SimulatedCase made;
  SimulatedView view;
  view.true_view.name = "AP";
  view.true_view.view.intrinsics.fx = view.true_view.view.intrinsics.fy = f_px;
  view.true_view.view.camera_from_world.translation = {0, 0, 700};
  made.views.push_back(view);
  phantom::CalibratorBall ball;
  ball.label = "P1";
  ball.centre_in_calibrator = {0, 0, 0};
  ball.diameter_mm = diameter_mm;
  made.calibrator.balls.push_back(ball);
  return made;
}

TEST(BallSizes, BelowThreePixelsAreWarnedOf) {
  const auto warnings = ball_size_warnings(seen_with(875, 2));
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].reason, Reason::few_fiducials);
  EXPECT_THAT(warnings[0].message, HasSubstr("balls of 2 mm are only 2.5 px wide in AP"));
  EXPECT_NEAR(warnings[0].figures.at("ball_px"), 2.5, 1e-9);
}

TEST(BallSizes, OfThreePixelsAreNot) { EXPECT_THAT(ball_size_warnings(seen_with(1060, 2)), IsEmpty()); }

TEST(BallSizes, WithoutBallsThereIsNoWarning) { EXPECT_THAT(ball_size_warnings({}), IsEmpty()); }

}  // namespace
}  // namespace helicarm::simulation
