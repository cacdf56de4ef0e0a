// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/marker_fit.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "helicarm/track/contrast_model.h"

namespace helicarm::track {
namespace marker_fit_test {

constexpr double radius = 2, share = 0.6, scatter = 25;

/// Profiled discs that take their share of what is above the scatter, on a slope.
image::Image<float> shadowed(std::span<const Eigen::Vector2d> centres, double level, double noise,
                             unsigned seed) {
  constexpr int size = 40;
  const detection::BallProfile profile(0.4, 0.8);
  image::Image<float> grey(size, size);
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  for (int v = 0; v < size; ++v)
    for (int u = 0; u < size; ++u) {
      double primary = (level - scatter) * (1 + 0.01 * (u - size / 2));
      for (const Eigen::Vector2d& centre : centres)
        primary *=
            1 - share * double(profile.at(float((Eigen::Vector2d(u, v) - centre).norm() / radius)).value);
      grey(u, v) = float(scatter + primary + noise * normal(random));
    }
  return grey;
}

MarkerAppearance sharp() {
  MarkerAppearance appearance;
  appearance.profile = detection::BallProfile(0.4, 0.8);
  return appearance;
}

KnownMarker expected_near(const Eigen::Vector2d& at, double sigma_px) {
  return {
      at, sigma_px * sigma_px * Eigen::Matrix2d::Identity(), radius, {-share * scatter, share, 0.1, true}};
}

TEST(MarkerFit, WeakMarkersAreFoundWithinTheirBands) {
  int found = 0, inside = 0;
  for (unsigned seed = 1; seed <= 60; ++seed) {
    const Eigen::Vector2d at(20.3 + 0.01 * seed, 19.6);
    const auto grey = shadowed({&at, 1}, 35, 1.5, seed);
    const auto fit = fit_known_marker(grey, expected_near({20, 20}, 0.6), {}, sharp());
    if (!fit || fit->evidence < 1.65) continue;
    ++found;
    for (int k = 0; k < 2; ++k) inside += std::abs(fit->image.uv_raw[k] - at[k]) < 1.96 * fit->image.sigma_px;
  }
  EXPECT_GT(found, 54);
  EXPECT_NEAR(inside / (2.0 * found), 0.95, 0.06);
}

TEST(MarkerFit, BackgroundAloneIsNoMarker) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    const auto grey = shadowed({}, 35, 1.5, seed);
    const auto fit = fit_known_marker(grey, expected_near({20, 20}, 0.6), {}, sharp());
    EXPECT_TRUE(!fit || fit->evidence < 1.65) << seed;
  }
}

TEST(MarkerFit, NeighbourThatTouchesDoesNotPull) {
  const std::array centres{Eigen::Vector2d(18.7, 20.2), Eigen::Vector2d(22.1, 21.0)};
  const auto grey = shadowed(centres, 130, 2, 3);
  const KnownNeighbour other{centres[1] + Eigen::Vector2d(0.1, -0.1), radius};
  const auto fit = fit_known_marker(grey, expected_near({19, 20}, 0.5), {&other, 1}, sharp());
  ASSERT_TRUE(fit);
  EXPECT_LT((fit->image.uv_raw - centres[0]).norm(), 0.12);
}

TEST(MarkerFit, SlopeBehindAMarkerDoesNotPull) {
  const Eigen::Vector2d at(20.2, 19.9);
  image::Image<float> grey = shadowed({&at, 1}, 130, 0, 1);
  const auto fit = fit_known_marker(grey, expected_near({20, 20}, 0.5), {}, sharp());
  ASSERT_TRUE(fit);
  EXPECT_LT((fit->image.uv_raw - at).norm(), 0.01);
}

TEST(ContrastModel, LineOverBackgroundIsLearnt) {
  ContrastLearner learner;
  EXPECT_FALSE(learner.model().is_known);
  for (int i = 0; i < 12; ++i) {
    const double background = 40 + 8 * i;
    learner.add({{0, 0}, 0.05, radius, share * (background - scatter), background}, 1);
  }
  const ContrastModel model = learner.model();
  EXPECT_NEAR(model.at(35), share * 10, 0.5);
  EXPECT_NEAR(model.at(150), share * 125, 1);
}

}  // namespace marker_fit_test
}  // namespace helicarm::track
