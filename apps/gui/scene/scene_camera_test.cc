// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/scene_camera.h"

#include <gtest/gtest.h>

#include "gui/scene/simulated_result_test.h"

namespace helicarm::gui {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

ResultScene scene() { return scene_of(*simulated().result, simulated().given.calibrator); }

void expect_inside(const SceneCamera& camera, double aspect, const Vector3d& place) {
  const auto seen = seen_at(camera, aspect, place);
  ASSERT_TRUE(seen);
  EXPECT_LE(seen->cwiseAbs().maxCoeff(), 1);
}

TEST(SceneCamera, EachViewsCameraContainsTheCalibratorAndTheWholeImage) {
  const ResultScene shown = scene();
  for (const ViewShape& view : shown.views)
    for (const double aspect : {0.5, 1.0, 2.5}) {
      const SceneCamera camera = camera_through(view, {0, 0, 40}, aspect);
      for (const phantom::CalibratorBall& ball : shown.balls)
        expect_inside(camera, aspect, ball.centre_in_calibrator);
      for (const Vector3d& corner : view.detector) expect_inside(camera, aspect, corner);
    }
}

TEST(SceneCamera, EachViewsCameraAgreesWithItsImage) {
  for (const ViewShape& view : scene().views) {
    const SceneCamera camera = camera_through(view, {0, 0, 40}, 1);
    const geometry::Intrinsics& k = view.view.intrinsics;
    const Vector3d place(20, -15, 60), other(-12, 30, 20);
    const Vector2d way = *seen_at(camera, 1, other) - *seen_at(camera, 1, place);
    const Vector2d in_image = view.view.project(other) - view.view.project(place);
    const double right = k.fx > 0 ? in_image.x() : -in_image.x();
    EXPECT_NEAR(way.x() / right, -way.y() / in_image.y(), 0.02 * std::abs(way.x() / right));
    EXPECT_GT(way.x() / right, 0);
  }
}

TEST(SceneCamera, OverviewContainsAllPositions) {
  std::vector<Vector3d> places{{0, 0, -900}, {500, 400, 0}, {-300, 800, 100}};
  for (const double aspect : {0.6, 1.0, 3.0}) {
    const SceneCamera camera = overview_of(places, aspect);
    EXPECT_NEAR(camera.up.dot(camera.forward()), 0, 1e-9);
    for (const Vector3d& place : places) expect_inside(camera, aspect, place);
  }
  expect_inside(overview_of({}, 1), 1, {0, 0, 0});
}

TEST(SceneCamera, ContentFollowsTheMouse) {
  const SceneCamera camera = overview_of(std::vector<Vector3d>{{0, 0, 0}, {100, 100, 100}}, 1);
  const Vector3d near = camera.focal_point - 20 * camera.forward();
  const Vector2d before = *seen_at(camera, 1, near);
  const Vector2d turned_to = *seen_at(turned(camera, 0.1, 0.05), 1, near);
  EXPECT_GT(turned_to.x(), before.x());
  EXPECT_GT(turned_to.y(), before.y());
  EXPECT_NEAR(turned(camera, 0.1, 0.05).distance(), camera.distance(), 1e-9);
  const Vector2d shifted_to = *seen_at(shifted(camera, 0.25, 0.1), 1, camera.focal_point);
  EXPECT_NEAR(shifted_to.x(), 0.5, 1e-9);
  EXPECT_NEAR(shifted_to.y(), 0.2, 1e-9);
  EXPECT_NEAR(zoomed(camera, 2).distance(), camera.distance() / 2, 1e-9);
  EXPECT_GT(zoomed(camera, 1e9).distance(), 1);
}

TEST(SceneCamera, PositionBehindTheCameraHasNoProjection) {
  const SceneCamera camera = overview_of({}, 1);
  EXPECT_FALSE(seen_at(camera, 1, camera.position - camera.forward()));
}

TEST(SceneCamera, ThousandRotationsKeepItUpright) {
  SceneCamera camera = overview_of({}, 1);
  for (int i = 0; i < 1000; ++i) camera = turned(camera, 0.3, 0.2);
  EXPECT_NEAR(camera.up.norm(), 1, 1e-9);
  EXPECT_NEAR(camera.up.dot(camera.forward()), 0, 1e-9);
}

}  // namespace
}  // namespace helicarm::gui
