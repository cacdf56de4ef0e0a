// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/register_model.h"

#include <atomic>
#include <stdexcept>

#include <gmock/gmock.h>

#include "helicarm/registration/checks.h"
#include "helicarm/registration/covariance.h"
#include "helicarm/registration/surface_scene_test.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using geometry::RigidTransform;

Model model_of(const volume::Volume& volume) {
  return *model_from("bone", volume, std::nullopt, HuWindow{150, 3000});
}

RigidTransform start_near(const Model& model, const RigidTransform& pose) {
  RigidStep step;
  step << 0.08, -0.06, 0.07, 4, -3, 5;
  return moved_about(pose, pose * model.centre, step);
}

RegistrationOptions quick() {
  RegistrationOptions options;
  options.threads = 1;
  options.search = {8, 8, 200};
  options.search.anywhere_after_refusal = false;
  options.names_causes = false;
  return options;
}

TEST(RegisterModel, FindsAVolumeInImagesOfAnotherRenderer) {
  const auto volume = lopsided_bone();
  const Model model = model_of(volume);
  const auto result = register_model(model, two_views(volume), {start_near(model, true_pose())}, quick());
  EXPECT_NE(result.decision, Decision::refuse) << (result.failure ? result.failure->message : "");
  EXPECT_LT(separation(model, result.world_from_model, true_pose()), 0.3);
  EXPECT_LT(worst_error_mm(model, result), 1.5);
}

TEST(RegisterModel, AgreementOfEachPatchIsInTheResult) {
  const auto volume = lopsided_bone();
  const Model model = model_of(volume);
  const auto result = register_model(model, two_views(volume), {start_near(model, true_pose())}, quick());
  for (const RegisteredView& view : result.views) {
    ASSERT_EQ(view.agreements.size(), std::size_t(view.comparisons));
    double score = 0, nearest = 1e9;
    for (const LocalAgreement& each : view.agreements) {
      score += each.weight * each.agreement;
      // Patches lie side by side on a lattice.
      const Eigen::Vector2d off = (each.pixel - view.agreements.front().pixel) / view.comparison_px;
      EXPECT_LT((off - off.array().round().matrix()).norm(), 1e-6);
      if (off.norm() > 0) nearest = std::min(nearest, off.norm());
    }
    EXPECT_NEAR(nearest, 1, 1e-6);
    EXPECT_NEAR(score, view.score, 1e-9);
  }
}

TEST(RegisterModel, IsInterruptedWithinTheSearch) {
  const auto volume = lopsided_bone();
  const Model model = model_of(volume);
  for (const unsigned threads : {1U, 3U}) {
    RegistrationOptions options = quick();
    options.threads = threads;
    std::atomic<int> calls = 0, steps = 0;
    options.search.interrupt = [&] {
      if (++calls >= 20) throw std::runtime_error("stop");
    };
    options.on_step = [&](std::string_view) { ++steps; };
    EXPECT_THROW(register_model(model, two_views(volume), {start_near(model, true_pose())}, options),
                 std::runtime_error);
    EXPECT_EQ(steps, 2) << "in the search, the second step";
  }
}

TEST(RegisterModel, ResultDoesNotDependOnThreads) {
  const auto volume = lopsided_bone();
  const Model model = model_of(volume);
  const auto views = two_views(volume);
  RegistrationOptions options = quick();
  const auto one = register_model(model, views, {start_near(model, true_pose())}, options);
  options.threads = 3;
  const auto three = register_model(model, views, {start_near(model, true_pose())}, options);
  EXPECT_EQ(one.world_from_model.matrix(), three.world_from_model.matrix());
  EXPECT_EQ(one.covariance, three.covariance);
}

TEST(RegisterModel, RefusesABodyThatMovedBetweenTheAcquisitions) {
  const auto volume = lopsided_bone();
  const Model model = model_of(volume);
  auto views = two_views(volume);
  RigidTransform moved = true_pose();
  moved.translation.z() += 3;  // across both viewing directions
  views[1] = image_of(volume, moved, view_from(80), "LAT", 2);
  const auto result = register_model(model, views, {start_near(model, true_pose())}, quick());
  ASSERT_TRUE(result.failure);
}

TEST(RegisterModel, RefusesAnotherSize) {
  const Model model = model_of(lopsided_bone(1.04));
  const auto result =
      register_model(model, two_views(lopsided_bone()), {start_near(model, true_pose())}, quick());
  ASSERT_TRUE(result.failure);
  EXPECT_THAT(result.failure->reason, testing::AnyOf(Reason::wrong_model, Reason::registration_disagrees));
}

TEST(RegisterModel, ABodyOutsideTheImagesHasNoCovariance) {
  const Model model = model_of(lopsided_bone());
  RigidTransform start = true_pose();
  start.translation.z() += 400;
  const auto result = register_model(model, two_views(lopsided_bone()), {start}, quick());
  ASSERT_TRUE(result.failure);
  EXPECT_EQ(result.failure->reason, Reason::wrong_model);
  EXPECT_THAT(result.failure->message, testing::HasSubstr("0 of its edges can be compared with AP"));
  EXPECT_FALSE(result.is_determined());
}

TEST(RegisterModel, OneViewStatesItsDepthAsUncertain) {
  const auto volume = lopsided_bone();
  const Model model = model_of(volume);
  auto views = two_views(volume);
  const auto both = register_model(model, views, {start_near(model, true_pose())}, quick());
  views.pop_back();
  const auto one = register_model(model, views, {start_near(model, true_pose())}, quick());
  const auto depth_sigma = [&](const Registration& result) {
    const Vector3d ray = (result.centre - view_from(0).source_in_world()).normalized();
    return std::sqrt(ray.dot(result.covariance.bottomRightCorner<3, 3>() * ray));
  };
  EXPECT_GT(depth_sigma(one), 3 * depth_sigma(both));
}

TEST(RegisterModel, TheModelsSizeIsPartOfTheDepthOfOneView) {
  const Model model = model_of(lopsided_bone(1.01));
  auto views = two_views(lopsided_bone());
  views.pop_back();
  const Vector3d ray =
      Vector3d(true_pose() * model_of(lopsided_bone()).centre - view_from(0).source_in_world());
  const auto error_in_sigmas = [&](double scale_sigma) {
    RegistrationOptions options = quick();
    options.scale_sigma = scale_sigma;
    const auto result = register_model(model, views, {start_near(model, true_pose())}, options);
    EXPECT_EQ(result.notes.at(0).reason, Reason::depth_from_scale);
    EXPECT_NEAR(result.notes.at(0).figures.at("mm_per_percent"), 0.01 * ray.norm(), 0.002 * ray.norm());
    const Vector3d along = ray.normalized();
    const double error = along.dot(result.centre - view_from(0).source_in_world()) - ray.norm();
    return error / std::sqrt(along.dot(result.covariance.bottomRightCorner<3, 3>() * along));
  };
  const double stated = error_in_sigmas(0.01);
  EXPECT_LT(std::abs(stated), 1.5);
  EXPECT_GT(error_in_sigmas(0), 2 * stated);
}

TEST(RegisterModel, TheModelsSizeMovesAPointAwayFromTheCentre) {
  Registration result;
  result.covariance.setZero();
  result.scale_sigma = 0.005;
  const Eigen::Matrix3d covariance = point_covariance(result, {100, 0, 0});
  EXPECT_NEAR(std::sqrt(covariance(0, 0)), 0.5, 1e-9);
  EXPECT_NEAR(covariance.trace(), covariance(0, 0), 1e-12);
}

TEST(RegisterModel, SuggestsAWiderSearchToAStartThatIsFarAway) {
  const auto volume = lopsided_bone();
  const Model model = model_of(volume);
  RigidTransform start = true_pose();
  start.translation += Vector3d(9, 0, -22);
  const auto result = register_model(model, two_views(volume), {start}, quick());
  ASSERT_TRUE(result.failure);
  EXPECT_THAT(result.failure->message, testing::HasSubstr("--search-mm 16"));
}

TEST(RegisterModel, ViewsThatATooLargeModelMovesApartHaveTheSizeInCommon) {
  const std::vector<RegistrationView> views = two_views(lopsided_bone());
  std::vector<OwnSolution> own(2);
  for (std::size_t i = 0; i < 2; ++i) {
    own[i].covariance = 0.01 * RigidCovariance::Identity();
    own[i].by_scale.tail<3>() = 3 * (-views[i].view.source_in_world()).normalized();
    own[i].step = own[i].by_scale;
  }
  EXPECT_LT(disagreement_of(views, Vector3d::Zero(), own).chi2, 1.5);
  for (OwnSolution& each : own) each.by_scale.setZero();
  EXPECT_GT(disagreement_of(views, Vector3d::Zero(), own).chi2, 100);
}

TEST(Covariance, MatchesTheScatterOfNoise) {
  const auto volume = lopsided_bone();
  const Model model = model_of(volume);
  const Level level{false, 1};
  double mean = 0;
  constexpr int trials = 12;
  for (std::uint32_t trial = 0; trial < trials; ++trial) {
    const std::vector<RegistrationView> views = {
        image_of(volume, true_pose(), view_from(0), "AP", 2 * trial, 0.01),
        image_of(volume, true_pose(), view_from(80), "LAT", 2 * trial + 1, 0.01)};
    RegistrationProblem scene(model, views, 1);
    scene.prepare(level, true_pose() * model.centre);
    const Estimate estimate = refine(scene, level, true_pose(), {});
    const Vector3d centre = estimate.pose * model.centre;
    const auto sum = linearised(estimate.observation, {}, {20, 20});
    const RigidStep error = step_about(estimate.pose, true_pose(), centre);
    const ErrorModel errors{views, scene.model().radius_mm, {}, {20, 20}, {0.1, 0.05}};
    const RigidCovariance covariance = sum.covariance() + errors.of_edges(estimate.observation, centre);
    mean += error.dot(covariance.inverse() * error) / trials;
  }
  EXPECT_GT(mean, 1);
  EXPECT_LT(mean, 14);
}

TEST(Motion, CameraChangesAreMotionsOfTheModel) {
  geometry::View view = view_from(30);
  view.intrinsics = {1300, 1250, 80, 70, 3};
  const Vector3d centre(2, -3, 4);
  const auto map = affine_from_camera(view, centre);
  const Vector3d point(12, 9, -20);
  constexpr double step = 1e-4;
  for (int k = 0; k < 11; ++k) {
    geometry::View changed = view;
    double* const intrinsics[] = {&changed.intrinsics.fx, &changed.intrinsics.fy, &changed.intrinsics.u0,
                                  &changed.intrinsics.v0};
    if (k < 4) *intrinsics[k] += step;
    if (k >= 4 && k < 7)
      changed.camera_from_world.rotation =
          geometry::rotation_from_vector(step * Vector3d::Unit(k - 4)) * view.camera_from_world.rotation;
    if (k >= 7 && k < 10) changed.camera_from_world.translation[k - 7] += step;
    if (k == 10) changed.intrinsics.skew += step;
    Eigen::Matrix3d linear;
    for (int i = 0; i < 3; ++i) linear.row(i) = map.col(k).segment<3>(3 + 3 * i).transpose();
    const Vector3d moved = point + step * (map.col(k).head<3>() + linear * (point - centre));
    EXPECT_LT((changed.project(point) - view.project(moved)).norm(), 1e-6) << k;
  }
}

TEST(RegisterModel, FindsASurfaceByItsContour) {
  const Model model = *model_from("implant", lopsided_surface());
  RigidTransform pose;
  pose.rotation = geometry::rotation_from_vector({0.3, 0.5, -0.2});
  const auto result =
      register_model(model, two_views(filled_volume(model), pose), {start_near(model, pose)}, quick());
  EXPECT_LT(separation(model, result.world_from_model, pose), 0.4);
}

TEST(RegisterModel, FindsTheSurfaceOfAGrownMask) {
  const Model body = *model_from("body", lopsided_surface());
  const Model model = *model_from("bone", stepped_surface());
  RigidTransform pose;
  pose.rotation = geometry::rotation_from_vector({0.3, 0.5, -0.2});
  const auto result =
      register_model(model, two_views(filled_volume(body), pose), {start_near(model, pose)}, quick());
  EXPECT_FALSE(result.failure) << result.failure->message;
  EXPECT_LT(separation(model, result.world_from_model, pose), worst_error_mm(model, result));
}

}  // namespace
}  // namespace helicarm::registration
