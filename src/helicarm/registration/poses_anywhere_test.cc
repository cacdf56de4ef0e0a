// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/poses_anywhere.h"

#include <Eigen/Geometry>
#include <gmock/gmock.h>

#include "helicarm/registration/register_model.h"
#include "helicarm/registration/scene_test.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;

Model bone_of(const volume::Volume& volume) {
  return *model_from("bone", volume, std::nullopt, HuWindow{150, 3000});
}

RegistrationOptions two_threads() {
  RegistrationOptions options;
  options.threads = 2;
  return options;
}

/// Ellipsoid of three different axes: turned by 180 degrees about each it is itself.
volume::Volume symmetric_bone() {
  volume::Volume volume;
  volume.size = {48, 48, 60};
  for (int z = 0; z < 60; ++z)
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 48; ++x) {
        const Vector3d at(x - 23.5, y - 23.5, z - 29.5);
        volume.voxels.push_back(at.cwiseQuotient(Vector3d(10, 16, 26)).norm() < 1 ? 1200.0F : -1024.0F);
      }
  return volume;
}

TEST(PosesAnywhere, FindAModelWithoutAStart) {
  const auto volume = lopsided_bone();
  const Model model = bone_of(volume);
  const auto result = register_model(model, two_views(volume), {}, two_threads());
  EXPECT_NE(result.decision, Decision::refuse) << result.failure->message;
  EXPECT_LT(separation(model, result.world_from_model, true_pose()), 0.3);
  EXPECT_TRUE(result.anywhere);
}

TEST(PosesAnywhere, AreSearchedAfterARefusalAboutTheStart) {
  const auto volume = lopsided_bone();
  const Model model = bone_of(volume);
  RegistrationOptions options = two_threads();
  options.search.candidates = 1;  // the start alone
  RigidStep step;
  step << 0.5, -0.4, 0.3, 12, -9, 8;
  const RigidTransform start = moved_about(true_pose(), true_pose() * model.centre, step);
  options.search.anywhere_after_refusal = false;
  options.names_causes = false;
  ASSERT_TRUE(register_model(model, two_views(volume), {start}, options).failure);
  options.search.anywhere_after_refusal = true;
  const auto result = register_model(model, two_views(volume), {start}, options);
  EXPECT_NE(result.decision, Decision::refuse) << result.failure->message;
  EXPECT_LT(separation(model, result.world_from_model, true_pose()), 0.3);
  ASSERT_FALSE(result.notes.empty());
  EXPECT_EQ(result.notes.back().reason, Reason::out_of_capture);
}

double degrees_between(const RigidTransform& a, const RigidTransform& b) {
  return Eigen::AngleAxisd(a.rotation.transpose() * b.rotation).angle() * 180 / EIGEN_PI;
}

TEST(PosesAnywhere, OfTheOtherOrientationsLieBetweenTheFirst) {
  const auto volume = lopsided_bone();
  const Model model = bone_of(volume);
  const auto views = two_views(volume);
  RegistrationProblem scene(model, views, 2);
  scene.prepare(level_anywhere(model), middle_of(views));
  const auto first = poses_anywhere(scene, Orientations::first, 1);
  const auto between = poses_anywhere(scene, Orientations::between, 1);
  ASSERT_EQ(first.size(), 1U);
  ASSERT_EQ(between.size(), 1U);
  EXPECT_GT(degrees_between(first[0], between[0]), 3);
  EXPECT_LT(degrees_between(first[0], true_pose()), 15);
  EXPECT_LT(degrees_between(between[0], true_pose()), 15);
}

TEST(PosesAnywhere, TheShareGrowsToTheWhole) {
  const auto volume = lopsided_bone();
  const Model model = bone_of(volume);
  RegistrationOptions options = two_threads();
  std::vector<double> shares;
  options.search.share = [&](double share) { shares.push_back(share); };
  ASSERT_FALSE(register_model(model, two_views(volume), {}, options).failure);
  EXPECT_GT(shares.size(), 100U);
  EXPECT_TRUE(std::ranges::is_sorted(shares));
  EXPECT_EQ(shares.back(), 1);
}

TEST(PosesAnywhere, OfASymmetricBodyAreRefusedAndListed) {
  const auto volume = symmetric_bone();
  const Model model = bone_of(volume);
  RigidTransform pose = true_pose();
  pose.translation = -(pose.rotation * model.centre);
  RegistrationOptions options = two_threads();
  std::vector<std::string> searches;
  options.on_step = [&](std::string_view step) {
    if (step.starts_with("search")) searches.emplace_back(step);
  };
  std::vector<double> shares;
  options.search.share = [&](double share) { shares.push_back(share); };
  const auto result = register_model(model, two_views(volume, pose), {}, options);
  EXPECT_THAT(searches, testing::ElementsAre("search anywhere", "search", "search anywhere"))
      << "about what was found, then in other orientations";
  EXPECT_TRUE(std::ranges::is_sorted(shares)) << "a wider search goes on where the one before ended";
  ASSERT_TRUE(result.failure);
  EXPECT_THAT(result.failure->reason, testing::AnyOf(Reason::registration_ambiguous, Reason::wrong_model));
  ASSERT_EQ(result.alternatives.size(), 2U);
  for (const Alternative& each : result.alternatives) {
    EXPECT_GT(each.distance_mm, 5);
    EXPECT_NEAR((each.world_from_model * model.centre - result.centre).norm(), 0, 2);
  }
}

}  // namespace
}  // namespace helicarm::registration
