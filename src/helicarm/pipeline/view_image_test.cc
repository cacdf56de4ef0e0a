// SPDX-License-Identifier: Apache-2.0
#include "helicarm/pipeline/view_image.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/image/png.h"

namespace helicarm::pipeline {
namespace {

class ViewImage : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(write_file(file(), image::encode_png(image::Image<std::uint8_t>(8, 6, 100))));
  }
  std::filesystem::path file() const { return folder_.path() / "a.png"; }
  CaseView view() const {
    CaseView view;
    view.name = "AP";
    view.image = file();
    return view;
  }

  TemporaryFolder folder_;
};

TEST_F(ViewImage, HasWhatItsViewStates) {
  CaseView stated = view();
  stated.pixel_mm = 0.25;
  stated.source_detector_mm = 990;
  const auto image = image_of(stated);
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(*image->acquisition.pixel_mm, Eigen::Vector2d(0.25, 0.25));
  EXPECT_EQ(image->acquisition.source_detector_mm, 990);
  EXPECT_TRUE(image->warnings.empty());
  EXPECT_FALSE(image_of(view())->acquisition.pixel_mm);
}

TEST_F(ViewImage, ContradictingItsViewIsRefused) {
  ASSERT_TRUE(write_file(folder_.path() / "a.json", R"({"pixel_mm": 0.2, "source_detector_mm": null})"));
  CaseView stated = view();
  stated.pixel_mm = 0.25;
  const auto refused = image_of(stated);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::bad_value);
  EXPECT_EQ(refused.error().view, "AP");
  EXPECT_NE(refused.error().message.find("case.json: view AP: \"pixel_mm\" is 0.25"), std::string::npos)
      << refused.error().message;
  stated.pixel_mm = 0.2005;
  EXPECT_EQ(image_of(stated)->acquisition.pixel_mm->x(), 0.2);
}

TEST_F(ViewImage, PlateImageHasItToo) {
  CaseView stated = view();
  stated.plate_image = file();
  stated.pixel_mm = 0.3;
  EXPECT_EQ(plate_image_of(stated)->acquisition.pixel_mm->x(), 0.3);
}

}  // namespace
}  // namespace helicarm::pipeline
