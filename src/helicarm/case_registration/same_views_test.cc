// SPDX-License-Identifier: Apache-2.0
#include "helicarm/case_registration/same_views.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/case_registration/register_case.h"

namespace helicarm::case_registration {
namespace same_views_test {

std::vector<measures::NamedView> calibrated(double shift_mm) {
  measures::NamedView view{"LAT", {}};
  view.view.camera_from_world.translation = {shift_mm, 0, 900};
  return {view};
}

Json registered() {
  CaseRegistration result;
  result.loaded.views.emplace_back().name = "LAT";
  result.loaded.views[0].view = calibrated(0)[0].view;
  return to_json(result);
}

TEST(SameViews, OfOneCalibrationPass) {
  EXPECT_TRUE(check_same_views(registered(), "r.json", calibrated(0)));
  EXPECT_TRUE(check_same_views(registered(), "r.json", calibrated(1)));  // another prior
}

TEST(SameViews, ACameraOfOtherImagesIsRefused) {
  const auto other = check_same_views(registered(), "r.json", calibrated(30));
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().reason, Reason::bad_value);
  EXPECT_THAT(other.error().message,
              testing::HasSubstr("r.json: view \"LAT\": its camera is 30.0 mm and 0.0"));
}

TEST(SameViews, FilesOfEarlierVersionsPass) {
  Json earlier = registered();
  earlier["views"][0].erase("camera_from_world");
  EXPECT_TRUE(check_same_views(earlier, "r.json", calibrated(30)));
  EXPECT_TRUE(check_same_views(Json::object(), "r.json", calibrated(30)));
}

}  // namespace same_views_test
}  // namespace helicarm::case_registration
