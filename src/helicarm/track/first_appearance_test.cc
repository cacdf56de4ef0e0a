// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/first_appearance.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

namespace helicarm::track {
namespace first_appearance_test {

constexpr int size = 140;
constexpr double background = 3000, absorbance = 1.2;
const std::vector<Eigen::Vector2d> centres{
    {30.2, 33.1}, {70.7, 36.4}, {108.4, 31.9}, {42.1, 96.3}, {97.5, 100.2}};

/// Balls, each at the mean over a Gaussian of positions.
xray::XrayImage balls(double radius, double blur_px, bool bright) {
  xray::XrayImage image{"A", image::Image<float>(size, size), 0, 65535, {}, {}};
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const int reach = blur_px > 0 ? 5 : 0;
  double weights = 0;
  for (int i = -reach; i <= reach; ++i) weights += std::exp(-0.125 * i * i);
  for (int v = 0; v < size; ++v)
    for (int u = 0; u < size; ++u) image.pixels(u, v) = float(background + 8 * normal(random));
  for (const Eigen::Vector2d& centre : centres)
    for (int part = 0; part < (2 * reach + 1) * (2 * reach + 1); ++part) {
      const int i = part % (2 * reach + 1) - reach, k = part / (2 * reach + 1) - reach;  // half a blur apart
      const Eigen::Vector2d at = centre + 0.5 * blur_px * Eigen::Vector2d(i, k);
      const double share = std::exp(-0.125 * (i * i + k * k)) / (weights * weights);
      for (int v = int(at.y() - radius); v <= int(at.y() + radius) + 1; ++v)
        for (int u = int(at.x() - radius); u <= int(at.x() + radius) + 1; ++u) {
          const double square = (Eigen::Vector2d(u, v) - at).squaredNorm() / (radius * radius);
          if (square >= 1) continue;
          const double taken = background * (1 - std::exp(-absorbance * std::sqrt(1 - square))) * share;
          image.pixels(u, v) += float(bright ? taken : -taken);
        }
    }
  return image;
}

std::vector<PickedPlace> picks_of(double radius) {
  std::vector<PickedPlace> picks;
  for (std::size_t i = 0; i < centres.size(); ++i)
    picks.push_back({i, centres[i] + Eigen::Vector2d(0.8, -0.6), radius});
  return picks;
}

TEST(FirstAppearance, SharpAndBlurredBallsHaveTheirSizeAndContrast) {
  const double contrast = background * (1 - std::exp(-absorbance)), radius = 4.35;
  for (const bool bright : {false, true})
    for (const double blur_px : {0.0, 1.0}) {
      const auto image = balls(radius, blur_px, bright);
      const LearntAppearance learnt = learnt_appearance(image, picks_of(radius), 6);
      EXPECT_EQ(learnt.appearance.polarity, bright ? -1 : 1);
      EXPECT_NEAR(learnt.appearance.radius_factor, 1, 0.1) << blur_px;
      const auto found = picked_marker(image, centres[1], radius, 8, learnt.appearance);
      ASSERT_TRUE(found);
      EXPECT_NEAR(std::abs(found->image.contrast) / contrast, 1, 0.15) << blur_px;
      EXPECT_LT((found->image.uv_raw - centres[1]).norm(), 0.1);
    }
}

TEST(FirstAppearance, WrongSizeIsContradicted) {
  const auto image = balls(4.35, 0.8, false);
  const auto warning_for = [&](double factor) {
    const SizeRange range = learnt_appearance(image, picks_of(factor * 4.35), 6).sizes;
    return size_contradiction({range, range}, factor * 3);
  };
  EXPECT_FALSE(warning_for(1));
  const auto warning = warning_for(0.7);
  ASSERT_TRUE(warning);
  EXPECT_EQ(warning->reason, Reason::scale_disagrees);
}

TEST(FirstAppearance, NothingIsLearntWithoutADisc) {
  const xray::XrayImage image{"A", image::Image<float>(size, size, 100.0F), 0, 255, {}, {}};
  EXPECT_EQ(learnt_appearance(image, picks_of(3), 6).sizes.markers, 0U);
}

}  // namespace first_appearance_test
}  // namespace helicarm::track
