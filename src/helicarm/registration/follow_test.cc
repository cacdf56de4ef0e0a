// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/follow.h"

#include <gtest/gtest.h>

#include "helicarm/registration/scene_test.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;

/// The true pose after `frame` equal steps.
RigidTransform pose_at(int frame) {
  RigidStep step;
  step << 0.03, -0.02, 0.01, 1.5, -1, 2;
  const Vector3d centre = true_pose() * Vector3d(-4, 34, 35);
  return moved_about(true_pose(), centre, frame * step);
}

RegistrationOptions follow_options() {
  RegistrationOptions options;
  options.threads = 1;
  options.search = {4, 4, 30};
  return options;
}

Model bone() { return *model_from("bone", lopsided_bone(), std::nullopt, HuWindow{150, 3000}); }

TEST(Follower, FollowsAMotion) {
  const Model model = bone();
  Follower follower(model, {pose_at(0)}, follow_options());
  for (int frame = 0; frame < 4; ++frame) {
    const auto result = follower.next(two_views(lopsided_bone(), pose_at(frame)), frame);
    EXPECT_FALSE(result.failure) << result.failure->message;
    EXPECT_LT(separation(model, result.world_from_model, pose_at(frame)), 0.4) << frame;
    EXPECT_GT(result.covariance.trace(), 0);
  }
}

TEST(Follower, ExpectsTheMotionToGoOn) {
  const Model model = bone();
  Follower follower(model, {pose_at(0)}, follow_options());
  EXPECT_FALSE(follower.predicted(0));
  for (const int frame : {0, 1}) follower.next(two_views(lopsided_bone(), pose_at(frame)), frame);
  EXPECT_LT(separation(model, *follower.predicted(2), pose_at(2)), 1);
}

TEST(Follower, GoesOnFromEarlierResultsAsIfItHadMadeThem) {
  const Model model = bone();
  Follower follower(model, {pose_at(0)}, follow_options()), later(model, {pose_at(0)}, follow_options());
  for (const int frame : {0, 1})
    later.take(follower.next(two_views(lopsided_bone(), pose_at(frame)), frame), frame);
  const auto images = two_views(lopsided_bone(), pose_at(2));
  EXPECT_EQ(follower.next(images, 2).world_from_model.matrix(),
            later.next(images, 2).world_from_model.matrix());
}

TEST(Follower, KeepsTheWarningOfAPartThatThePoseDoesNotExplain) {
  const Model model = bone();
  Follower follower(model, {pose_at(0)}, follow_options()), later(model, {pose_at(0)}, follow_options());
  Registration first = follower.next(two_views(lopsided_bone(), pose_at(0)), 0);
  first.warnings.push_back({Reason::wrong_model, "a part", {}, {{"agreement_elsewhere", 0.8}}});
  later.take(first, 0);
  for (const int frame : {1, 2}) {
    const auto result = later.next(two_views(lopsided_bone(), pose_at(frame)), frame);
    EXPECT_EQ(result.decision, Decision::warn) << frame;
    EXPECT_EQ(result.warnings.back(), first.warnings.back()) << frame;
  }
}

TEST(Follower, RefusesImagesWithoutTheBodyAndFindsItAgain) {
  const Model model = bone();
  Follower follower(model, {pose_at(0)}, follow_options());
  for (const int frame : {0, 1}) follower.next(two_views(lopsided_bone(), pose_at(frame)), frame);
  auto blank = two_views(lopsided_bone(), pose_at(2));
  for (auto& view : blank)
    for (float& grey : view.grey.pixels()) grey = 2000;
  EXPECT_TRUE(follower.next(blank, 2).failure);
  const auto again = follower.next(two_views(lopsided_bone(), pose_at(3)), 3);
  EXPECT_LT(separation(model, again.world_from_model, pose_at(3)), 0.4);
}

TEST(Follower, FindsABodyThatJumps) {
  const Model model = bone();
  Follower follower(model, {pose_at(0)}, follow_options());
  for (const int frame : {0, 1}) follower.next(two_views(lopsided_bone(), pose_at(frame)), frame);
  RigidStep step;
  step << 0.5, -0.4, 0.3, 12, -9, 8;
  const RigidTransform there = moved_about(pose_at(1), pose_at(1) * model.centre, step);
  const auto found = follower.next(two_views(lopsided_bone(), there), 2);
  ASSERT_FALSE(found.failure) << found.failure->message;
  EXPECT_LT(separation(model, found.world_from_model, there), 0.4);
  EXPECT_EQ(found.decision, Decision::warn);
  EXPECT_EQ(found.warnings.back().reason, Reason::out_of_capture);
  // The jump is no velocity.
  EXPECT_LT(separation(model, *follower.predicted(3), there), 0.4);
}

TEST(Follower, DoesNotSearchAnywhereInEachImageWhileTheBodyIsGone) {
  const Model model = bone();
  Follower follower(model, {pose_at(0)}, follow_options());
  follower.next(two_views(lopsided_bone(), pose_at(0)), 0);
  Registration refused;
  refused.failure = Failure{Reason::wrong_model, "", {}, {}};
  for (int frame = 1; frame <= 2; ++frame) follower.take(refused, frame);
  RigidStep step;
  step << 0.5, -0.4, 0.3, 12, -9, 8;
  const auto views = two_views(lopsided_bone(), moved_about(pose_at(0), pose_at(0) * model.centre, step));
  EXPECT_TRUE(follower.next(views, 3).failure);
}

TEST(RelativePose, HasTheErrorsOfBothBodies) {
  Registration reference, model;
  reference.world_from_model = true_pose();
  reference.centre = {0, 0, 0};
  reference.covariance = RigidCovariance::Zero();
  reference.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 0.01, 0.01, 0.01;
  model.world_from_model = {Eigen::Matrix3d::Identity(), Vector3d(10, 0, 0)};
  model.centre = {10, 0, 0};
  model.covariance = reference.covariance;
  const RelativePose relative = relative_pose(reference, model);
  const RigidTransform back = reference.world_from_model * relative.reference_from_model;
  EXPECT_LT((back.matrix() - model.world_from_model.matrix()).norm(), 1e-12);
  // A rotation of the reference moves a point 10 mm from its centre across.
  EXPECT_NEAR((relative.covariance.bottomRightCorner<3, 3>().trace()), 6 * 0.01 + 2 * 100 * 1e-4, 1e-12);
  EXPECT_NEAR((relative.covariance.topLeftCorner<3, 3>().trace()), 6 * 1e-4, 1e-12);
}

}  // namespace
}  // namespace helicarm::registration
