// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/mirror.h"

#include <gmock/gmock.h>

#include "helicarm/registration/register_model.h"
#include "helicarm/registration/surface_scene_test.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;

RigidTransform turned_pose() { return {geometry::rotation_from_vector({0.3, 0.5, -0.2}), {1, -2, 3}}; }

Registration registered(const Model& model, const std::vector<RegistrationView>& views) {
  RegistrationOptions options;
  options.threads = 1;
  options.search = {6, 6, 100};
  RigidStep step;
  step << 0.05, -0.04, 0.05, 3, -2, 2;
  const RigidTransform pose = turned_pose();
  return register_model(model, views, {moved_about(pose, pose * model.centre, step)}, options);
}

TEST(MirrorImage, OfASymmetricSurfaceIsTheSurfaceItself) {
  const Model model = *model_from("tray", symmetric_surface());
  const auto result = registered(model, two_views(filled_volume(model), turned_pose()));
  EXPECT_EQ(result.mirrored_ratio, std::nullopt);
  EXPECT_NE(result.decision, Decision::refuse) << (result.failure ? result.failure->message : "");
  EXPECT_LT(separation(model, result.world_from_model, turned_pose()), 0.4);
}

TEST(MirrorImage, OfALopsidedSurfaceFitsWorse) {
  const Model model = *model_from("implant", lopsided_surface());
  const auto result = registered(model, two_views(filled_volume(model), turned_pose()));
  ASSERT_TRUE(result.mirrored_ratio);
  EXPECT_GT(*result.mirrored_ratio, 1.1);
  EXPECT_NE(result.decision, Decision::refuse) << (result.failure ? result.failure->message : "");
}

TEST(MirrorImage, OfALopsidedSurfaceInTheImagesIsRefused) {
  phantom::TriangleMesh other_side = lopsided_surface();
  for (Vector3d& corner : other_side.corners) corner.z() = -corner.z();
  const Model shown = *model_from("other side", other_side);
  const Model model = *model_from("implant", lopsided_surface());
  const auto result = registered(model, two_views(filled_volume(shown), turned_pose()));
  EXPECT_EQ(result.decision, Decision::refuse);
}

TEST(DistanceFromASurface, EqualsThatFromItsBalls) {
  const std::vector<Ball> balls = {{{0, 0, 0}, 14}, {{12, 5, 10}, 9}};
  const Surface surface = *prepare_surface(surface_of_balls(balls), "balls");
  for (const Vector3d& point :
       {Vector3d(20, 0, 0), Vector3d(-9, 15, 3), Vector3d(22, 12, 18), Vector3d(1, -2, 3)}) {
    double expected = 1e9;
    for (const Ball& ball : balls) expected = std::min(expected, (point - ball.centre).norm() - ball.radius);
    EXPECT_NEAR(distance(surface, point), std::abs(expected), 0.1);
  }
}

}  // namespace
}  // namespace helicarm::registration
