// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/find_marks.h"

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"

namespace helicarm::detection {
namespace find_marks_test {

const Eigen::Vector2d centre(60.3, 40.7);

/// One ball on an image that is not square: dark, or bright where the grey values are inverted.
xray::XrayImage ball_image(bool bright) {
  drawn::Shade shade(130, 90);
  drawn::add_ball(shade, centre, 7, 0.9, 3);
  RandomStream random(6, 3);
  xray::XrayImage image;
  image.pixels = image::Image<float>(130, 90);
  for (std::size_t i = 0; i < image.pixels.pixels().size(); ++i) {
    const double dark = 3000 - 2000 * double(shade.pixels()[i]) + 10 * random.normal();
    image.pixels.pixels()[i] = float(bright ? 4095 - dark : dark);
  }
  return image;
}

TEST(FindMarks, BallIsFoundWhicheverWayMetalShows) {
  for (const bool bright : {false, true}) {
    const auto found = find_marks(ball_image(bright), MarkKind::balls);
    ASSERT_EQ(found.size(), 1u) << bright;
    EXPECT_LT((found[0].centre_px - centre).norm(), 0.1) << bright;
  }
}

TEST(FindMarks, HoleIsBrightOnly) {
  EXPECT_TRUE(find_marks(ball_image(false), MarkKind::holes).empty());
  EXPECT_EQ(find_marks(ball_image(true), MarkKind::holes).size(), 1u);
}

TEST(FindMarks, UnknownKindIsUsage) {
  EXPECT_EQ(*mark_kind("crosses"), MarkKind::crosses);
  EXPECT_EQ(mark_kind("cats").error().reason, Reason::usage);
}

}  // namespace find_marks_test
}  // namespace helicarm::detection
