// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>

#include "helicarm/registration/causes.h"
#include "helicarm/registration/scene_test.h"

namespace helicarm::registration {
namespace not_explained_test {

using Eigen::Vector3d;
using geometry::RigidTransform;
using testing::Contains, testing::Field, testing::Not;

constexpr int image_px = 320;
constexpr double break_z = 90;

/// A bone of 120 mm, whose part above `break_z` is displaced along x.
volume::Volume long_bone(double displaced_mm) {
  volume::Volume volume;
  volume.size = {72, 64, 128};
  volume.patient_from_voxel = Eigen::Translation3d(-36, -32, -64) * Eigen::Scaling(1.0);
  const auto inside = [](const Vector3d& at, const Vector3d& centre, const Vector3d& radii) {
    return (at - centre).cwiseQuotient(radii).squaredNorm() < 1;
  };
  for (int z = 0; z < 128; ++z)
    for (int y = 0; y < 64; ++y)
      for (int x = 0; x < 72; ++x) {
        const Vector3d at(z > break_z ? x - displaced_mm : x, y, z);
        const bool marrow = inside(at, {34, 30, 62}, {9, 11, 50});
        const bool bone = inside(at, {34, 30, 62}, {14, 16, 58}) || inside(at, {48, 36, 20}, {16, 13, 16}) ||
                          inside(at, {22, 42, 98}, {13, 9, 10}) || inside(at, {38, 20, 46}, {15, 10, 9});
        volume.voxels.push_back(marrow ? 100.0F : bone ? 1200.0F : -1024.0F);
      }
  return volume;
}

/// The whole bone, registered in images in which its part is displaced.
Registration registered(double displaced_mm, bool names_causes = true) {
  const Model model = *model_from("bone", long_bone(0), std::nullopt, HuWindow{150, 3000});
  const RigidTransform pose{geometry::rotation_from_vector({0.1, -0.1, 0.4}), Vector3d::Zero()};
  std::vector<RegistrationView> views;
  for (const double degrees : {0.0, 80.0})
    views.push_back(image_of(long_bone(displaced_mm), pose, view_from(degrees, image_px),
                             degrees == 0 ? "AP" : "LAT", views.empty() ? 1 : 2, 0.003, image_px));
  RegistrationOptions options;
  options.threads = 1;
  options.search = {2, 2, 10};
  options.search.anywhere_after_refusal = false;
  options.names_causes = names_causes;
  return register_model(model, views, {pose}, options);
}

const auto is_of_part = Field(&Warning::reason, Reason::wrong_model);

TEST(PartNotExplained, ABoneThatIsBrokenInTheImagesIsWarnedOf) {
  const Registration result = registered(6);
  ASSERT_FALSE(result.failure) << result.failure->message;
  EXPECT_EQ(result.decision, Decision::warn);
  ASSERT_THAT(result.warnings, Contains(is_of_part));
  const auto& figures = std::ranges::find(result.warnings, Reason::wrong_model, &Warning::reason)->figures;
  EXPECT_NEAR(figures.at("z_mm"), break_z - 64, 12);
  EXPECT_GT(figures.at("agreement_alone"), figures.at("agreement") + 0.2);
  EXPECT_NEAR(figures.at("moved_mm"), 6, 1);
  ASSERT_TRUE(result.not_explained);
  EXPECT_TRUE(result.not_explained->may_have({-2, -2, 40}));
  EXPECT_FALSE(result.not_explained->may_have({-2, -2, -40}));
}

TEST(PartNotExplained, AWholeBoneIsNot) {
  const Registration result = registered(0);
  EXPECT_FALSE(result.failure);
  EXPECT_THAT(result.warnings, Not(Contains(is_of_part)));
}

TEST(PartNotExplained, ARefusedRegistrationHasNoSuchWarning) {
  Registration refused;
  refused.failure = Failure{Reason::wrong_model, "refused"};
  const Model model = *model_from("bone", lopsided_bone(), std::nullopt, HuWindow{150, 3000});
  warn_of_part_not_explained(model, two_views(lopsided_bone()), nullptr, refused);
  EXPECT_TRUE(refused.warnings.empty());
  EXPECT_EQ(refused.decision, Decision::refuse);
}

}  // namespace not_explained_test
}  // namespace helicarm::registration
