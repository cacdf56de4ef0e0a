// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/scene_camera.h"

#include <gtest/gtest.h>

#include "gui/scene/simulated_result_test.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::gui {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

ResultScene scene() { return scene_of(*simulated().result, simulated().the_case.calibrator); }

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

SceneCamera outside_camera() { return {{500, 0, 0}, {0, 0, 0}, {0, 0, 1}, 28}; }

TEST(Obstructs, LinkAroundOrCloseBeforeTheCameraOnly) {
  const SceneCamera camera = outside_camera();
  const auto link = [](double x, double y) { return DrawnLink{{{x, y, -200}, {x, y, 200}}, 26, 30}; };
  EXPECT_TRUE(obstructs(camera, link(510, 0)));    // around it
  EXPECT_TRUE(obstructs(camera, link(400, 0)));    // fills the window
  EXPECT_FALSE(obstructs(camera, link(400, 80)));  // beside the window
  EXPECT_FALSE(obstructs(camera, link(40, 0)));    // narrow at that distance
  EXPECT_FALSE(obstructs(camera, link(700, 0)));   // behind the camera
}

/// The arm with its tool on each tunnel's axis, from before its entry to its end, in every posture.
std::vector<LiveScene> flights() {
  std::vector<LiveScene> all;
  const auto& points = simulated().truth.navigation->points;
  for (std::size_t start = 0; start + 1 < points.size(); start += 2) {
    const Vector3d from = points[start].in_calibrator, way = points[start + 1].in_calibrator - from;
    const Eigen::Matrix3d turn = geometry::rotation_between(Vector3d::UnitZ(), way);
    for (const double base_y : {520.0, -520.0})
      for (double depth = -250; depth <= way.norm(); depth += 25) {
        LiveScene live;
        live.calibrator_from_tip = geometry::RigidTransform{turn, from + depth * way.normalized()};
        live.calibrator_from_base = geometry::RigidTransform{Eigen::Matrix3d::Identity(), {60, base_y, -160}};
        const geometry::RigidTransform calibrator_from_flange =
            *live.calibrator_from_tip * geometry::RigidTransform{Eigen::Matrix3d::Identity(), {0, 0, -150}};
        for (const robot::Joints& joints :
             robot::inverse(robot::ur5(), live.calibrator_from_base->inverse() * calibrator_from_flange)) {
          live.joints = joints;
          all.push_back(live);
        }
      }
  }
  return all;
}

TEST(Obstructs, NoDrawnLinkHoldsTheCameraOnAnyFlight) {
  const ResultScene shown = scene();
  std::vector<Vector3d> places;
  for (const phantom::CalibratorBall& ball : shown.balls) places.push_back(ball.centre_in_calibrator);
  std::vector<SceneCamera> cameras{overview_of(places, 1), zoomed(overview_of(places, 1), 3)};
  for (const ViewShape& view : shown.views) cameras.push_back(camera_through(view, {0, 0, 40}, 1));
  const std::vector<LiveScene> all = flights();
  ASSERT_GT(all.size(), 50u);
  constexpr double shortest_link_mm = 1;  // shorter ones are not drawn
  int hidden = 0;
  for (const LiveScene& live : all)
    for (const SceneCamera& camera : cameras)
      for (const DrawnLink& link : drawn_links(live)) {
        const Vector3d along = link.axis.to - link.axis.from;
        if (along.norm() <= shortest_link_mm) continue;
        const double part =
            std::clamp((camera.position - link.axis.from).dot(along) / along.squaredNorm(), 0.0, 1.0);
        const double distance = (camera.position - link.axis.from - part * along).norm();
        if (obstructs(camera, link))
          ++hidden;
        else
          ASSERT_GT(distance, link.radius_mm);
      }
  EXPECT_GT(hidden, 0);
}

}  // namespace
}  // namespace helicarm::gui
