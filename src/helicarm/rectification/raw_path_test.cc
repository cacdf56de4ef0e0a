// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/raw_path.h"

#include <gtest/gtest.h>

#include "helicarm/rectification/models/polynomial.h"

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;

/// About 15 px of pincushion at the edge of a 512 px image.
DistortionMap pincushion() {
  DistortionMap map = identity_map(512, 512, {});
  Eigen::MatrixX2d coefficients = Eigen::MatrixX2d::Zero(10, 2);
  coefficients.topRows(3) << 255.5, 255.5, 250, 0, 0, 250;
  coefficients.bottomRows(4) << 15, 0, 0, 15, 15, 0, 0, 15;
  map.model = polynomial_model(3, {{255.5, 255.5}, 250}, coefficients);
  return map;
}

double distance_to_piece(const Vector2d& at, const Vector2d& a, const Vector2d& b) {
  const double share = std::clamp((at - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (at - a - share * (b - a)).norm();
}

TEST(RawPaths, FollowTheCurvedLine) {
  const DistortionMap map = pincushion();
  const Vector2d from(30, 60), to(450, 110);
  const auto paths = raw_paths(map, PixelPath{from, to});
  ASSERT_EQ(paths.size(), 1u);
  EXPECT_LT((paths[0].front() - map.raw_from_rectified(from)).norm(), 1e-9);
  EXPECT_LT((paths[0].back() - map.raw_from_rectified(to)).norm(), 1e-9);
  double straight = 0;
  for (double share = 0; share <= 1; share += 0.003) {
    const Vector2d raw = map.raw_from_rectified(from + share * (to - from));
    double nearest = 1e9;
    for (std::size_t i = 1; i < paths[0].size(); ++i)
      nearest = std::min(nearest, distance_to_piece(raw, paths[0][i - 1], paths[0][i]));
    EXPECT_LT(nearest, 0.1);
    straight = std::max(straight, distance_to_piece(raw, paths[0].front(), paths[0].back()));
  }
  EXPECT_GT(straight, 2);
}

TEST(RawPaths, EndAtTheImageBorderForAnyLength) {
  const DistortionMap map = pincushion();
  const auto paths = raw_paths(map, PixelPath{{-1e6, 256}, {1e6, 256}});
  ASSERT_EQ(paths.size(), 1u);
  EXPECT_LT(paths[0].size(), 200u);
  EXPECT_LT(paths[0].front().x(), 20);
  EXPECT_GT(paths[0].back().x(), 490);
  for (const Vector2d& place : paths[0]) EXPECT_TRUE(map.shows(place));
}

TEST(RawPaths, AreCutAtTheImageBorder) {
  const DistortionMap map = identity_map(100, 100, {});
  const auto paths = raw_paths(map, PixelPath{{10, 10}, {10, 500}, {90, 500}, {90, 10}, {50, 10}});
  ASSERT_EQ(paths.size(), 2u);
  EXPECT_EQ(paths[1].back(), Vector2d(50, 10));
  EXPECT_TRUE(raw_paths(map, PixelPath{{200, 10}, {200, 90}}).empty());
  EXPECT_TRUE(raw_paths(map, PixelPath{{20, 10}}).empty());
  EXPECT_TRUE(raw_paths(map, {}).empty());
}

TEST(RawPaths, LineFromFarAwayContinuesAtACorner) {
  const DistortionMap map = identity_map(100, 100, {});
  const auto paths = raw_paths(map, PixelPath{{-1000, 50}, {50, 50}, {50, 1000}});
  ASSERT_EQ(paths.size(), 1u);
  ASSERT_EQ(paths[0].size(), 3u);
  EXPECT_LT((paths[0].front() - Vector2d(0, 50)).norm(), 1e-9);
  EXPECT_LT((paths[0].back() - Vector2d(50, 99)).norm(), 1e-9);
}

}  // namespace
}  // namespace helicarm::rectification
