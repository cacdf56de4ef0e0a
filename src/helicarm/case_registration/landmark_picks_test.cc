// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/landmark_picks.h"

#include <gmock/gmock.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/registration/scene_test.h"

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

class LandmarkPicks : public testing::Test {
 protected:
  LandmarkPicks() {
    for (const double angle : {0.0, 80.0}) {
      registration::RegistrationView view;
      view.name = angle == 0 ? "AP" : "LAT";
      view.view = registration::view_from(angle);
      loaded_.views.push_back(view);
      loaded_.maps.emplace_back();
    }
    asked_.name = "bone";
    asked_.landmarks = folder_.path() / "points.csv";
    std::string rows = "name,x_mm,y_mm,z_mm\n";
    for (const auto& [name, at] : places_) {
      rows += std::string(name) + "," + std::to_string(at.x()) + "," + std::to_string(at.y()) + "," +
              std::to_string(at.z()) + "\n";
      for (const auto& view : loaded_.views) {
        pipeline::Pick pick;
        pick.name = name;
        pick.view = view.name;
        pick.uv_raw = view.view.project(at);
        pick.sigma_px = 0.2;
        given_.picks.push_back(pick);
      }
    }
    EXPECT_TRUE(write_file(*asked_.landmarks, rows));
  }
  Expected<std::vector<registration::Landmark>> picked() {
    return guarded([&] { return picked_landmarks(asked_, given_, loaded_, loaded_.views); });
  }

  const std::vector<std::pair<const char*, Vector3d>> places_ = {
      {"a", {12, -6, 4}}, {"b", {-15, -10, -15}}, {"c", {-3, 18, 12}}, {"d", {8, 9, -20}}};
  const TemporaryFolder folder_;
  pipeline::CaseModel asked_;
  pipeline::Case given_;
  LoadedViews loaded_;
};

TEST_F(LandmarkPicks, LieWhereTheirRaysMeet) {
  const auto landmarks = picked();
  ASSERT_TRUE(landmarks) << landmarks.error().message;
  ASSERT_EQ(landmarks->size(), 4u);
  for (const registration::Landmark& landmark : *landmarks)
    EXPECT_LT((landmark.in_world - landmark.in_model).norm(), 1e-3);
}

TEST_F(LandmarkPicks, NamesExchangedInOneViewAreNamed) {
  std::swap(given_.picks[1].uv_raw, given_.picks[5].uv_raw);  // a and c in LAT
  const auto landmarks = picked();
  ASSERT_FALSE(landmarks);
  EXPECT_EQ(landmarks.error().reason, Reason::residual_too_large);
  EXPECT_THAT(landmarks.error().message, HasSubstr("\"a\" and \"c\""));
}

TEST_F(LandmarkPicks, RaysThatMissEnlargeTheCovariance) {
  const auto exact = picked();
  given_.picks[1].uv_raw.y() += 8;
  const auto missed = picked();
  ASSERT_TRUE(missed) << missed.error().message;
  EXPECT_GT(missed->front().covariance_in_world.trace(), 20 * exact->front().covariance_in_world.trace());
}

TEST_F(LandmarkPicks, ALandmarkTwiceInTheFileIsRefused) {
  EXPECT_TRUE(write_file(*asked_.landmarks, "name,x_mm,y_mm,z_mm\na,1,2,3\na,1,2,4\n"));
  EXPECT_EQ(picked().error().reason, Reason::name_clash);
}

}  // namespace
}  // namespace helicarm::case_registration
