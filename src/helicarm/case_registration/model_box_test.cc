// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/model_box.h"

#include <fmt/format.h>
#include <gmock/gmock.h>

namespace helicarm::case_registration {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

/// A bone of 60 x 60 x 100 mm whose middle is far from the scanner's.
ModelBox far_bone() {
  ModelBox box;
  box.low = {110, -70, 400}, box.high = {170, -10, 500};
  return box;
}

Expected<std::vector<Warning>> placed(const ModelBox& box, const std::vector<Vector3d>& points) {
  return guarded([&] {
    std::vector<PlacedPoint> named;
    for (const Vector3d& point : points) named.push_back({fmt::format("p{}", named.size()), point});
    return check_places("femur", "plan.mrk.json", box, named);
  });
}

TEST(CheckPlaces, PointsInsideOrJustOutsideAreSilent) {
  const auto checked = placed(far_bone(), {{140, -40, 450}, {178, -40, 450}});
  ASSERT_TRUE(checked);
  EXPECT_TRUE(checked->empty());
}

TEST(CheckPlaces, RasIsAskedFor) {
  const auto checked = placed(far_bone(), {{-140, 40, 450}, {-120, 60, 420}});
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().reason, Reason::bad_value);
  EXPECT_THAT(checked.error().message, HasSubstr("is it in RAS?"));
  EXPECT_THAT(checked.error().message, HasSubstr("plan.mrk.json"));
}

TEST(CheckPlaces, CentimetresAndMetresAreAskedFor) {
  EXPECT_THAT(placed(far_bone(), {{14, -4, 45}}).error().message, HasSubstr("is it in cm?"));
  EXPECT_THAT(placed(far_bone(), {{0.14, -0.04, 0.45}}).error().message, HasSubstr("is it in m?"));
  EXPECT_THAT(placed(far_bone(), {{-14, 4, 45}}).error().message, HasSubstr("is it in RAS and cm?"));
}

TEST(CheckPlaces, FartherThanTenMillimetresIsWarnedOf) {
  const auto checked = placed(far_bone(), {{140, -40, 450}, {190, -40, 450}});
  ASSERT_TRUE(checked);
  ASSERT_EQ(checked->size(), 1u);
  EXPECT_EQ(checked->front().reason, Reason::outside_model);
  EXPECT_NEAR(checked->front().figures.at("distance_mm"), 20, 1e-9);
  EXPECT_THAT(checked->front().message, HasSubstr("1 of 2 points"));
}

TEST(CheckPlaces, FartherThanTheBoxIsLargeIsRefused) {
  EXPECT_TRUE(placed(far_bone(), {{265, -40, 450}}));
  EXPECT_FALSE(placed(far_bone(), {{275, -40, 450}}));
}

TEST(CheckPlaces, LandmarksAloneAreExtrapolatedAndWarnedOf) {
  std::vector<registration::Landmark> landmarks;
  for (const Vector3d& at : {Vector3d(100, -20, 0), Vector3d(140, -20, 0), Vector3d(120, 10, 5)})
    landmarks.push_back({"a", at, at});
  EXPECT_TRUE(placed(box_of(landmarks), {{120, 0, 40}})->empty());
  const auto far = placed(box_of(landmarks), {{-120, 0, 4}});
  ASSERT_TRUE(far);
  EXPECT_THAT(far->at(0).message, HasSubstr("is it in RAS?"));
}

TEST(ModelBoxOf, IsThatOfTheBodyInItsVolume) {
  volume::Volume volume;
  volume.size = {30, 20, 25};
  volume.patient_from_voxel = Eigen::Translation3d(-200, 50, 7) * Eigen::Scaling(2.0, 1.0, 1.0);
  volume.voxels.assign(std::size_t(30) * 20 * 25, -1000);
  for (int z = 5; z < 20; ++z)
    for (int y = 4; y < 16; ++y)
      for (int x = 3; x < 27; ++x) volume.voxels[std::size_t(x + 30 * (y + 20 * z))] = 900;
  const auto model = registration::model_from("bone", volume, std::nullopt, registration::HuWindow{});
  ASSERT_TRUE(model) << model.error().message;
  const ModelBox box = box_of(*model);
  EXPECT_NEAR(box.largest_side_mm(), 48, 1e-6);
  EXPECT_EQ(box.distance_mm({-200 + 2 * 15, 50 + 10, 7 + 12}), 0);
  EXPECT_NEAR(box.distance_mm({-200 + 2 * 15, 50 + 15.5 + 30, 7 + 12}), 30, 1e-6);
}

}  // namespace
}  // namespace helicarm::case_registration
