// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/rectification/fit_map.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;

constexpr int image_side = 512;

/// 4 x 4 dots in one quarter of the image, with 6 px of pincushion about the image centre at its edge.
std::vector<Correspondence> quarter_of_a_plate(double bend_px) {
  RandomStream random(3, 5);
  std::vector<Correspondence> dots;
  for (int j = 0; j < 4; ++j)
    for (int i = 0; i < 4; ++i) {
      const Vector2d t = Vector2d(i, j) * 0.28;
      dots.push_back({100 * t,
                      Vector2d(255.5, 255.5) + 250 * t + bend_px * t.squaredNorm() * t +
                          0.03 * Vector2d(random.normal(), random.normal()),
                      0.05});
    }
  return dots;
}

double held_out_px(const std::string& model, double bend_px) {
  MapOptions options;
  options.model = model;
  return fit_map(quarter_of_a_plate(bend_px), image_side, image_side, options)->map.held_out_rms_px;
}

TEST(RadialModel, SixteenDotsDetermineAPincushion) {
  EXPECT_LT(held_out_px("radial", 6), 0.08);
  EXPECT_GT(held_out_px("polynomial", 6), 0.1);
}

TEST(RadialModel, IsChosenForFewBentDots) {
  EXPECT_EQ(fit_map(quarter_of_a_plate(6), image_side, image_side, {})->map.model->name(), "radial");
}

TEST(RadialModel, IsNotChosenForAStraightPlate) {
  EXPECT_EQ(fit_map(quarter_of_a_plate(0), image_side, image_side, {})->map.model->name(),
            "polynomial of order 1");
}

TEST(RadialModel, NineDotsAreTooFew) {
  auto dots = quarter_of_a_plate(6);
  dots.resize(9);
  MapOptions options;
  options.model = "radial";
  EXPECT_EQ(fit_map(dots, image_side, image_side, options).error().reason, Reason::plate_not_found);
}

}  // namespace
}  // namespace helicarm::rectification
