// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/models_at_starts.h"

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/volume/write_nrrd.h"

namespace helicarm::case_registration {
namespace models_at_starts_test {

/// A block in a CT, and two views across each other whose central rays meet at (10, 20, 30).
class ModelsAtStarts : public testing::Test {
 protected:
  ModelsAtStarts() {
    std::vector<std::uint8_t> bone;
    for (int i = 0; i < 24 * 24 * 24; ++i) {
      const int x = i % 24, y = i / 24 % 24, z = i / 576;
      const bool inside = std::min({x, y, z}) >= 4 && std::max({x, y, z}) < 20;
      bone.push_back(static_cast<std::uint8_t>(inside ? 250 : z));
    }
    EXPECT_TRUE(write_file(folder_.path() / "bone.nrrd",
                           volume::to_nrrd({24, 24, 24}, Eigen::Affine3d::Identity(), bone)));
    pipeline::CaseModel model;
    model.name = "bone";
    model.volume = folder_.path() / "bone.nrrd";
    model.window_hu = Eigen::Vector2d(150, 3000);
    case_.models = {model};
    Eigen::Matrix3d lateral;
    lateral << 0, 0, 1, 0, 1, 0, -1, 0, 0;
    for (const Eigen::Matrix3d& turn : {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), lateral}) {
      registration::RegistrationView& view = loaded_.views.emplace_back();
      view.grey = image::Image<float>(201, 101);
      view.view.intrinsics = {2000, 2000, 100, 50, 0};
      view.view.camera_from_world = {turn, Eigen::Vector3d(0, 0, 800) - turn * middle_};
      case_.views.emplace_back();
    }
  }

  RegisteredModel at_start() {
    const auto done = models_at_starts(case_, loaded_);
    if (!done) throw std::runtime_error(done.error().message);
    return done->models.at(0);
  }

  TemporaryFolder folder_;
  const Eigen::Vector3d middle_{10, 20, 30};
  pipeline::Case case_;
  LoadedViews loaded_;
};

TEST_F(ModelsAtStarts, WithoutAStartAModelIsInTheMiddleOfTheViews) {
  const RegisteredModel model = at_start();
  EXPECT_TRUE(model.registration.world_from_model.rotation.isIdentity());
  EXPECT_LT((model.registration.centre - middle_).norm(), 1e-3);
  ASSERT_EQ(model.outlines.size(), 2u);
  EXPECT_FALSE(model.outlines[0].empty());
  EXPECT_FALSE(model.registration.is_determined());
}

TEST_F(ModelsAtStarts, AModelOfOneViewIsOnItsCentralRay) {
  loaded_.views.pop_back();
  case_.views.pop_back();
  const RegisteredModel model = at_start();
  EXPECT_LT((model.views[0].project(model.registration.centre) - Eigen::Vector2d(100, 50)).norm(), 0.01);
}

TEST_F(ModelsAtStarts, TheStartOfTheCaseComesFirst) {
  const geometry::RigidTransform start{Eigen::Matrix3d::Identity(), {1, 2, 3}};
  case_.models[0].world_from_model = start;
  EXPECT_EQ(at_start().registration.world_from_model.translation, start.translation);
}

TEST_F(ModelsAtStarts, LandmarksThatAreNotPickedAreNoStart) {
  case_.models[0].placed_landmarks = {{"a", {4, 4, 4}}, {"b", {20, 4, 4}}, {"c", {4, 20, 4}}};
  EXPECT_LT((at_start().registration.centre - middle_).norm(), 1e-3);
}

TEST_F(ModelsAtStarts, WhyAGivenStartHasNoPoseIsANote) {
  EXPECT_TRUE(at_start().registration.notes.empty());
  case_.models[0].placed_landmarks = {{"a", {4, 4, 4}}, {"b", {20, 4, 4}}, {"c", {4, 20, 4}}};
  EXPECT_EQ(at_start().registration.notes.size(), 1u);
}

}  // namespace models_at_starts_test
}  // namespace helicarm::case_registration
