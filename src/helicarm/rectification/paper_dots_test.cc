// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/paper_dots.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "helicarm/detection/drawn_image_test.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;

TEST(FindDotsPaper, CirclesOfTheGivenSizeWithinOneAndAHalfPixels) {
  detection::drawn::Shade shade(256, 256);
  std::vector<Vector2d> places;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) places.emplace_back(50.3 + 75.4 * column, 50.6 + 75.2 * row);
  for (const Vector2d& place : places) detection::drawn::add_ball(shade, place, 8, 0.9, 3);
  image::Image<float> image = detection::drawn::grey(shade, 1500);
  RandomStream random(1, 1);
  detection::drawn::add_noise(image, 20, random);
  const auto dots = find_dots_paper(image, 0, 4095, 6, 10);
  EXPECT_EQ(dots.size(), places.size());
  for (const Vector2d& place : places)
    EXPECT_TRUE(std::any_of(dots.begin(), dots.end(), [&](const detection::Dot& dot) {
      return (dot.centre_px - place).norm() < 1.5 && dot.sigma_px == 0.45;
    })) << place.transpose();
}

TEST(FindDotsPaper, EmptyFieldHasNone) {
  EXPECT_TRUE(find_dots_paper(image::Image<float>(128, 128, 2000), 0, 4095, 6, 10).empty());
}

TEST(PaperStages, ShowTheCirclesWhereTheyWereFound) {
  image::Image<float> image(120, 90);
  for (float& pixel : image.pixels()) pixel = 1000;
  detection::Dot circle;
  circle.centre_px = {70.25, 40.5};
  circle.radius_px = 8;
  for (int y = 0; y < 90; ++y)
    for (int x = 0; x < 120; ++x)
      if ((Eigen::Vector2d(x, y) - circle.centre_px).norm() < 8) image(x, y) = 300;
  const PaperStages stages = paper_stages(image, 0, 1000, {circle});
  EXPECT_EQ(stages.raw(5, 5), 255);
  EXPECT_EQ(stages.median(70, 40), stages.raw(70, 40));
  EXPECT_EQ(stages.circles(70, 40), 255);
  EXPECT_EQ(stages.circles(82, 40), 0);
  EXPECT_EQ(stages.edges(70, 40), 0);
  const auto edges = stages.edges.pixels();
  EXPECT_GT(std::count(edges.begin(), edges.end(), 255), 30);
}

}  // namespace
}  // namespace helicarm::rectification
