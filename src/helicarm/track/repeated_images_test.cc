// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/repeated_images.h"

#include <gtest/gtest.h>

namespace helicarm::track {
namespace repeated_images_test {

const std::vector<std::string> views{"A", "B", "C"};

/// An image of its own for each key.
xray::XrayImage image_of(const std::string& key, bool is_constant = false) {
  xray::XrayImage made;
  made.pixels = image::Image<float>(4, 4);
  if (!is_constant) made.pixels(1, 2) = 100;
  made.acquisition.instance_key = key;
  return made;
}

std::vector<xray::XrayImage> images_of(const std::vector<std::string>& keys) {
  std::vector<xray::XrayImage> images;
  for (const std::string& key : keys) images.push_back(image_of(key));
  return images;
}

TEST(RepeatedImages, FrozenViewRepeatsItsLastImage) {
  RepeatedImages images;
  EXPECT_TRUE(images.among(4, images_of({"a4", "b4"})).empty());
  std::vector<std::vector<RepeatedImage>> found;
  for (const int frame : {5, 6, 7})
    found.push_back(images.among(frame, images_of({"a" + std::to_string(frame), frame < 7 ? "b4" : "b7"})));
  ASSERT_EQ(found[1].size(), 1u);
  EXPECT_EQ(found[1][0].view, 1u);
  EXPECT_EQ(found[1][0].of_frame, 4);
  EXPECT_TRUE(found[2].empty());
  const auto warnings = warnings_of_repeated(views, {5, 6, 7}, found);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0].reason, Reason::cameras_not_in_step);
  EXPECT_EQ(warnings[0].view, "B");
  EXPECT_TRUE(warnings[0].message.starts_with(
      "frame 5: the image of B is that of its frame 4 again; so are 2 images, of the frames 5-6"))
      << warnings[0].message;
}

TEST(RepeatedImages, OfTwoViewsThatAreTheSameEitherMayBeWrong) {
  RepeatedImages images;
  images.among(1, images_of({"a1", "b1", "c1"}));
  const auto found = images.among(2, images_of({"a2", "b2", "a2"}));
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].view + found[1].view, 2u);
  EXPECT_EQ(found[0].reason(), Reason::views_too_close);
  EXPECT_TRUE(too_many_repeated(found, 3));
  EXPECT_FALSE(too_many_repeated(found, 4));
  EXPECT_EQ(repeated_text(views, 2, found[0]), "frame 2: A and C are the same image");
}

TEST(RepeatedImages, EarlierImageOfAnotherViewIsNamed) {
  RepeatedImages images;
  images.among(1, images_of({"a1", "b1"}));
  const auto found = images.among(2, images_of({"a2", "a1"}));
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].reason(), Reason::views_too_close);
  EXPECT_EQ(repeated_text(views, 2, found[0]), "frame 2: the image of B is that of A in frame 1 again");
}

TEST(RepeatedImages, ImagesOfOneGreyValueAreNone) {
  RepeatedImages images;
  images.among(1, {image_of("a1"), image_of("black", true)});
  EXPECT_TRUE(images.among(2, {image_of("a2"), image_of("black", true)}).empty());
}

}  // namespace repeated_images_test
}  // namespace helicarm::track
