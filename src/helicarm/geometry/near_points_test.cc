// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/near_points.h"

#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace helicarm::geometry {
namespace {

using Eigen::Vector2d;
using testing::ElementsAre;
using testing::IsEmpty;

std::vector<Vector2d> scattered(std::size_t count, double width, double height) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> x(-width, width), y(100, 100 + height);
  std::vector<Vector2d> points;
  for (std::size_t i = 0; i < count; ++i) points.emplace_back(x(random), y(random));
  return points;
}

std::vector<std::size_t> by_search(const std::vector<Vector2d>& points, const Vector2d& place, double reach) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < points.size(); ++i)
    if ((points[i] - place).norm() <= reach) found.push_back(i);
  return found;
}

TEST(NearPoints, FindsWhatASearchOfAllFinds) {
  const auto points = scattered(400, 300, 200);
  for (const double cell : {0.0, 1e-6, 7.0, 1e6}) {
    const NearPoints near(points, cell);
    for (const double reach : {0.0, 3.0, 25.0, 1000.0})
      for (const Vector2d& place : scattered(20, 400, 300))
        ASSERT_EQ(near.within(place, reach), by_search(points, place, reach)) << cell << " " << reach;
  }
}

TEST(NearPoints, NearestAreThoseOfASort) {
  const auto points = scattered(150, 300, 2);
  const NearPoints near(points, 5);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::vector<std::pair<double, std::size_t>> sorted;
    for (std::size_t j = 0; j < points.size(); ++j)
      if (j != i) sorted.emplace_back((points[j] - points[i]).squaredNorm(), j);
    std::ranges::sort(sorted);
    const auto nearest = near.nearest_to(i, 8);
    ASSERT_EQ(nearest.size(), 8u);
    for (std::size_t k = 0; k < 8; ++k) ASSERT_EQ(nearest[k], sorted[k].second);
  }
}

TEST(NearPoints, OfFewerPointsAllAreNearest) {
  const std::vector<Vector2d> points{{0, 0}, {0, 0}, {3, 0}};
  EXPECT_THAT(NearPoints(points, 1).nearest_to(0, 8), ElementsAre(1, 2));
}

TEST(NearPoints, WithoutPointsNoneIsNear) { EXPECT_THAT(NearPoints({}, 1).within({0, 0}, 10), IsEmpty()); }

}  // namespace
}  // namespace helicarm::geometry
