// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/hypothesis.h"

#include <algorithm>

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <math.h>

#include "helicarm/fiducials/label_scene_test.h"

namespace helicarm::fiducials {
namespace {

using namespace label_scene;

/// A noise-free lateral image in which candidate k is ball k.
struct SyntheticScene {
  LabellingProblem scene;
  geometry::View view;
};

SyntheticScene synthetic_scene() {
  SyntheticScene all;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& ball : helix().balls) middle += ball.centre_in_calibrator / 12;
  all.view = {{4345, 4345, 511.5, 511.5}, {}};
  all.view.camera_from_world.rotation =
      Eigen::AngleAxisd(1.1, Eigen::Vector3d(3, 1, 0.5).normalized()).matrix();
  all.view.camera_from_world.translation = {3, -5, 700};
  all.scene.camera = {4345, 0.01, {511.5, 511.5}, 30};
  all.scene.field_radius_px = 504;
  all.scene.radius_bias = 0;
  all.scene.radius_bias_sigma = 0.03;
  for (const auto& ball : helix().balls) {
    const Eigen::Vector3d centre = ball.centre_in_calibrator - middle;
    const double radius = 4345 * ball.diameter_mm / 2 / all.view.depth(centre);
    all.scene.balls.push_back({centre, ball.diameter_mm / 2});
    all.scene.candidates.push_back({all.view.project(centre), 0.5, radius, 0.02 * radius});
  }
  return all;
}

TEST(Hypothesis, OutlierTestEqualsTheDistanceFromAFitToTheOthers) {
  auto [scene, view] = synthetic_scene();
  for (const double off_px : {1.6, 3.0}) {
    scene.candidates[4].uv = view.project(scene.balls[4].centre) + Eigen::Vector2d(off_px, 0);
    const Hypothesis h = match_and_fit(scene, view);
    ASSERT_EQ(h.matched, off_px > 2.5 ? 11 : 12);
    Hypothesis all = h;
    all.candidate_of_ball[4] = 4;
    all.fit =
        fit_pose(h.fit.view, correspondences_of(scene, all.candidate_of_ball, view), scene.camera, fit_steps);
    const auto balls = outlying(scene, all);
    const PoseFit others = without(scene, all, 4).fit;
    const Eigen::Vector2d off = scene.candidates[4].uv - others.view.project(scene.balls[4].centre);
    const Eigen::Matrix2d noise = 0.25 * Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d spread = noise + prediction_covariance(others, scene.balls[4].centre);
    const bool beyond = off.dot(spread.inverse() * off) > 3.3 * 3.3;
    EXPECT_EQ(beyond, !balls.empty() && balls.front() == 4) << off_px;
    EXPECT_EQ(beyond, off_px > 2.5);
  }
}

TEST(Hypothesis, OddsWriteNoGlobalVariable) {
  const auto [scene, view] = synthetic_scene();
  Hypothesis h = match_and_fit(scene, view);
  constexpr int untouched = 42;
  signgam = untouched;
  evaluate_odds(scene, h);
  EXPECT_EQ(signgam, untouched);
}

TEST(Hypothesis, OutlierNearAHiddenBallIsReplacedInARival) {
  auto [scene, view] = synthetic_scene();
  scene.candidates[7].uv += Eigen::Vector2d(0, 3.5);
  Hypothesis h = match_and_fit(scene, view);
  h.candidate_of_ball.assign(12, -1);
  for (const int k : {0, 2, 5, 7, 9, 11}) h.candidate_of_ball[k] = k;
  h.fit = fit_pose(h.fit.view, correspondences_of(scene, h.candidate_of_ball, view), scene.camera, fit_steps);
  const auto rivals = with_pair(scene, h, 4, 4);
  EXPECT_TRUE(std::any_of(rivals.begin(), rivals.end(), [](const Hypothesis& rival) {
    return rival.candidate_of_ball[4] == 4 && rival.candidate_of_ball[7] == -1 && rival.matched == 6;
  }));
}

}  // namespace
}  // namespace helicarm::fiducials
