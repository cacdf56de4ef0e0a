// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/marker_image.h"

#include <algorithm>
#include <array>
#include <random>

#include <gtest/gtest.h>

namespace helicarm::track {
namespace marker_image_test {

/// Discs by the share of each pixel that they cover, apart from the profile that is fitted.
xray::XrayImage drawn(std::span<const Eigen::Vector2d> centres, double radius, double contrast, double noise,
                      unsigned seed) {
  constexpr int size = 64, parts = 10;
  xray::XrayImage image{"A", image::Image<float>(size, size), 0, 255, {}, {}};
  std::mt19937 random(seed);
  std::normal_distribution<float> normal;
  for (int v = 0; v < size; ++v)
    for (int u = 0; u < size; ++u) {
      int inside = 0;
      for (int i = 0; i < parts * parts; ++i) {
        const Eigen::Vector2d at(u + (i % parts + 0.5) / parts - 0.5, v + (i / parts + 0.5) / parts - 0.5);
        for (const Eigen::Vector2d& centre : centres) inside += (at - centre).norm() < radius;
      }
      image.pixels(u, v) =
          float(130 + 0.2 * u - contrast * inside / (parts * parts)) + float(noise) * normal(random);
    }
  return image;
}

MarkerAppearance appearance_for(double contrast) {
  MarkerAppearance appearance;
  appearance.polarity = contrast > 0 ? 1 : -1;
  appearance.profile = detection::BallProfile(0.2, 8);
  return appearance;
}

TEST(MarkerImage, ThreePixelDiscsAreFoundToAFewHundredths) {
  for (const double contrast : {60.0, -60.0})
    for (unsigned seed = 1; seed <= 8; ++seed) {
      const std::array<Eigen::Vector2d, 1> centre{Eigen::Vector2d(30 + 0.13 * seed, 33 - 0.09 * seed)};
      const auto image = drawn(centre, 1.5, contrast, 2, seed);
      const SearchWindow window{{31, 32}, 6, 1.5, 0};
      const auto found = find_markers(image, {&window, 1}, appearance_for(contrast));
      const auto near = std::ranges::count_if(found, [&](const MarkerImage& disc) {
        return has_marker_size(disc, 1.5) && (disc.uv_raw - centre[0]).norm() < 0.12;
      });
      EXPECT_EQ(near, 1) << contrast << " " << seed;
    }
}

TEST(MarkerImage, OverlappingDiscsAreFittedTogether) {
  const std::array centres{Eigen::Vector2d(29.2, 32.3), Eigen::Vector2d(33.6, 31.1)};
  const auto image = drawn(centres, 2, 60, 1, 3);
  const SearchWindow window{{31, 32}, 8, 2, 0};
  const auto found = find_markers(image, {&window, 1}, appearance_for(60));
  for (const Eigen::Vector2d& centre : centres)
    EXPECT_TRUE(std::ranges::any_of(
        found, [&](const MarkerImage& disc) { return (disc.uv_raw - centre).norm() < 0.15; }));
}

TEST(MarkerImage, NothingIsPickedOnEmptyBackground) {
  const auto image = drawn({}, 2, 60, 2, 5);
  EXPECT_FALSE(picked_marker(image, {30, 30}, 2, 8, appearance_for(60)));
}

TEST(MarkerImage, PickTakesTheNearestDisc) {
  const std::array centres{Eigen::Vector2d(26, 30), Eigen::Vector2d(38, 30)};
  const auto image = drawn(centres, 2, 60, 2, 4);
  const auto found = picked_marker(image, {35.5, 31}, 2, 12, appearance_for(60));
  ASSERT_TRUE(found);
  EXPECT_LT((found->image.uv_raw - centres[1]).norm(), 0.15);
}

}  // namespace marker_image_test
}  // namespace helicarm::track
