// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/scene_values.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "gui/scene/simulated_result_test.h"
#include "helicarm/core/random.h"
#include "helicarm/geometry/ray.h"

namespace helicarm::gui {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

TEST(SceneValues, EllipsoidContains95PercentOfSamples) {
  const Matrix3d root = (Matrix3d() << 3, 0, 0, 1, 0.5, 0, -0.4, 0.2, 1).finished();
  const Vector3d centre(5, -3, 40);
  const Ellipsoid ellipsoid = ellipsoid_95(centre, root * root.transpose());
  EXPECT_NEAR(ellipsoid.axes.determinant(), 1, 1e-12);
  RandomStream random(1, 1);
  constexpr int trials = 20000;
  int inside = 0;
  for (int i = 0; i < trials; ++i) {
    const Vector3d sample = root * Vector3d(random.normal(), random.normal(), random.normal());
    inside += (ellipsoid.axes.transpose() * sample).cwiseQuotient(ellipsoid.radii).norm() <= 1;
  }
  EXPECT_NEAR(double(inside) / trials, 0.95, 0.006);
}

TEST(SceneValues, ExactPointHasNoExtent) {
  EXPECT_EQ(ellipsoid_95({1, 2, 3}, Matrix3d::Zero()).radii, Vector3d::Zero());
}

double distance_from(const Segment& ray, const Vector3d& point) {
  return (point - ray.from).cross((ray.to - ray.from).normalized()).norm();
}

TEST(SceneValues, RaysPassThroughTheirPointsAndEndOnTheDetectors) {
  const ResultScene scene = scene_of(*simulated().result, simulated().the_case.calibrator);
  ASSERT_EQ(scene.views.size(), 2u);
  ASSERT_EQ(scene.points.size(), 4u);
  for (const PointShape& point : scene.points) {
    ASSERT_EQ(point.rays.size(), 2u);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_LT(distance_from(point.rays[i], point.error.centre), 0.5) << point.name;
      const ViewShape& view = scene.views[i];
      const Vector3d across =
          (view.detector[1] - view.detector[0]).cross(view.detector[3] - view.detector[0]);
      EXPECT_NEAR(across.normalized().dot(point.rays[i].to - view.detector[0]), 0, 1e-6);
    }
  }
}

TEST(SceneValues, DetectorAgreesWithTheSimulatedOne) {
  const ResultScene scene = scene_of(*simulated().result, simulated().the_case.calibrator);
  for (std::size_t i = 0; i < 2; ++i) {
    const simulation::TrueView& true_view = simulated().truth.views[i].true_view;
    const ViewShape& view = scene.views[i];
    EXPECT_NEAR((view.central_ray.to - view.central_ray.from).norm(),
                true_view.view.intrinsics.fy * true_view.pixel_mm(), 15);
    EXPECT_NEAR((view.detector[1] - view.detector[0]).norm(), 512 * true_view.pixel_mm(), 4);
    EXPECT_LT((view.central_ray.from - true_view.view.source_in_world()).norm(), 15);
  }
}

TEST(SceneValues, TunnelsRunBetweenTheirPoints) {
  const ResultScene scene = scene_of(*simulated().result, simulated().the_case.calibrator);
  ASSERT_EQ(scene.tunnels.size(), 2u);
  EXPECT_EQ(scene.tunnels[0].axis.from, scene.points[0].error.centre);
  EXPECT_EQ(scene.tunnels[0].axis.to, scene.points[1].error.centre);
}

TEST(SceneValues, RefusedResultShowsOnlyTheCalibrator) {
  const ResultScene scene = scene_of({}, phantom::udcsc());
  EXPECT_EQ(scene.balls.size(), 12u);
  EXPECT_TRUE(scene.views.empty());
  EXPECT_TRUE(scene.points.empty());
}

TEST(SceneValues, ConeIsDrawnOnlyForBallsOnACone) {
  phantom::Calibrator calibrator = phantom::udcsc();
  const auto cone = cone_of(calibrator);
  ASSERT_TRUE(cone);
  for (const auto& [a, b, c] : cone->triangles) {  // outward orientation
    const Vector3d normal = (cone->corners[b] - cone->corners[a]).cross(cone->corners[c] - cone->corners[a]);
    EXPECT_GT(normal.head<2>().dot(cone->corners[a].head<2>()), 0);
  }
  calibrator.balls[3].centre_in_calibrator.head<2>() *= 0.4;
  EXPECT_FALSE(cone_of(calibrator));
}

TEST(SceneValues, MovedBoneIsStatedAtItsPointsAndNotForNoise) {
  ResultScene scene;
  for (const double x : {0, 10})
    scene.points.push_back({"TS",
                            localization::PointSource::pick,
                            "tibia",
                            {{x, 0, 0}, Matrix3d::Identity(), Vector3d::Ones()},
                            {}});
  const geometry::RigidTransform motion{Matrix3d::Identity(), {0, 0, 3.1}};
  const auto moved = moved_bone(scene, "tibia", motion);
  ASSERT_TRUE(moved);
  EXPECT_DOUBLE_EQ(moved->moved_mm, 3.1);
  EXPECT_EQ(moved->place, Vector3d(5, 0, 3.1));
  EXPECT_FALSE(moved_bone(scene, "femur", motion));
  EXPECT_FALSE(moved_bone(scene, "tibia", geometry::RigidTransform{Matrix3d::Identity(), {0.2, 0, 0.2}}));
}

case_registration::RegisteredModel registered_femur() {
  case_registration::RegisteredModel model;
  model.registration.name = "femur";
  model.registration.world_from_model.translation = {1, 2, 3};
  model.registration.covariance.setIdentity();
  model.model = std::make_shared<const registration::Model>();
  model.moves_with = "femur";
  for (const double z : {10, 30}) {
    case_registration::RegisteredPoint& point = model.points.emplace_back();
    point.name = z < 20 ? "tunnel_start" : "tunnel_end";
    point.place.in_calibrator = {0, 0, z};
    point.place.covariance_in_calibrator = Matrix3d::Identity();
  }
  model.tunnels.push_back({"tunnel", {}, {}, {}, 20});
  model.tunnel_ends.push_back({0, 1});
  return model;
}

TEST(SceneValues, RegisteredModelHasItsPlan) {
  const auto shape = shape_of(registered_femur(), {}, {1, 2, 3});
  ASSERT_TRUE(shape);
  EXPECT_EQ(shape->state, ModelShape::State::registered);
  EXPECT_EQ(shape->colour, (Colour{1, 2, 3}));
  EXPECT_EQ(shape->calibrator_from_model.translation, Vector3d(1, 2, 3));
  const ResultScene scene = with_plans({}, {*shape});
  ASSERT_EQ(scene.points.size(), 2u);
  EXPECT_EQ(scene.points[1].name, "tunnel_end");
  EXPECT_NEAR(scene.points[1].error.radii.x(), 2.795, 1e-3);
  ASSERT_EQ(scene.tunnels.size(), 1u);
  EXPECT_EQ(scene.tunnels[0].axis.to, Vector3d(0, 0, 30));
  EXPECT_EQ(scene.tunnels[0].moves_with, "femur");
}

TEST(SceneValues, RefusedOrMovedModelHasNoPlan) {
  case_registration::RegisteredModel model = registered_femur();
  const geometry::RigidTransform tried{Matrix3d::Identity(), {4, 4, 4}};
  auto shape = shape_of(model, tried, {});
  ASSERT_TRUE(shape);
  EXPECT_EQ(shape->state, ModelShape::State::by_hand);
  EXPECT_EQ(shape->calibrator_from_model.translation, tried.translation);
  EXPECT_TRUE(shape->points.empty() && shape->tunnels.empty());

  model.registration.failure = Failure{Reason::wrong_model, "femur: another bone", {}, {}};
  shape = shape_of(model, {}, {});
  ASSERT_TRUE(shape);
  EXPECT_EQ(shape->state, ModelShape::State::refused);
  EXPECT_TRUE(shape->points.empty() && shape->tunnels.empty());

  model.registration.covariance = registration::Registration{}.covariance;  // refused without a pose
  EXPECT_FALSE(shape_of(model, {}, {}));
}

TEST(SceneValues, ModelOfLandmarksHasItsPlanWithoutASurface) {
  case_registration::RegisteredModel model = registered_femur();
  model.model.reset();
  const auto shape = shape_of(model, {}, {});
  ASSERT_TRUE(shape);
  EXPECT_EQ(shape->tunnels.size(), 1u);
  model.registration.failure = Failure{Reason::uncertain, "femur", {}, {}};
  EXPECT_FALSE(shape_of(model, {}, {}));
}

TEST(SceneValues, RobotLinksEndAtTheFlange) {
  LiveScene live;
  EXPECT_TRUE(robot_links(live).empty());
  live.calibrator_from_base = geometry::RigidTransform{Matrix3d::Identity(), {60, 520, -160}};
  live.joints = (robot::Joints() << 0.1, -1.2, 1.4, -0.6, 0.3, 2).finished();
  const auto links = robot_links(live);
  ASSERT_EQ(links.size(), 6u);
  EXPECT_EQ(links.front().from, live.calibrator_from_base->translation);
  EXPECT_LT((links.back().to -
             *live.calibrator_from_base * robot::base_from_flange(robot::ur5(), *live.joints).translation)
                .norm(),
            1e-9);
  live.robot_model = "another";
  EXPECT_TRUE(robot_links(live).empty());
}

PointShape point_within(double radius_mm) {
  PointShape point{"P", localization::PointSource::pick, {}, {}, {}};
  point.error.radii.setConstant(radius_mm);
  return point;
}

TEST(ErrorScale, SmallEllipsoidsAreEnlargedTenTimesAndLargeOnesNot) {
  const auto scale = [](double radius_mm) {
    ResultScene scene;
    scene.points = {point_within(0.1), point_within(radius_mm)};
    return error_scale_of(scene, 10);
  };
  EXPECT_EQ(scale(1), 10);
  EXPECT_EQ(scale(3), 5);
  EXPECT_EQ(scale(9.8), 2);
  EXPECT_EQ(scale(30), 1);
}

TEST(SceneParts, HiddenOnesAreLeftOut) {
  ResultScene scene;
  scene.balls.resize(2);
  scene.points = {point_within(1)};
  scene.points[0].rays.resize(2);
  EXPECT_TRUE(only(all_parts & ~SceneParts(ScenePart::calibrator), scene).balls.empty());
  EXPECT_TRUE(only(all_parts & ~SceneParts(ScenePart::rays), scene).points[0].rays.empty());
  EXPECT_TRUE(only(all_parts & ~SceneParts(ScenePart::points), scene).points.empty());
  EXPECT_EQ(only(all_parts, scene).points.size(), 1u);
}

}  // namespace
}  // namespace helicarm::gui
