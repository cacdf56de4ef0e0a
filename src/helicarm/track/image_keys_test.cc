// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/image_keys.h"

#include <gtest/gtest.h>

namespace helicarm::track {
namespace image_keys_test {

const std::vector<std::string> views{"cam1", "side, left"};

TEST(ImageKeys, CompleteFramesAreReadBack) {
  const std::string text = image_keys_header() + image_keys_rows(4, views, {"a1", "b2"}) +
                           image_keys_rows(6, views, {"c3", "d4"}) + "8,cam1,e5\n8,";
  const auto read = image_keys_from(text, views, {4, 6, 8});
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[1], (ImageKeys{"c3", "d4"}));
  EXPECT_EQ(image_keys_from(text, views, {5, 6}).size(), 0u);
}

TEST(ImageKeys, ChangedImageIsNamed) {
  EXPECT_EQ(changed_image(4, views, {"a1", "b2"}, {"a1", "b2"}), "");
  EXPECT_NE(changed_image(4, views, {"a1", "b2"}, {"a1", "b3"}).find("frame 4: the image of side, left"),
            std::string::npos);
}

}  // namespace image_keys_test
}  // namespace helicarm::track
