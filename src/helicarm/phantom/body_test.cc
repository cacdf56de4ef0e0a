// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/body.h"

#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <tuple>

#include <gtest/gtest.h>

namespace helicarm::phantom {
namespace {

using Place = std::tuple<float, float, float>;

/// Number of directed edges (by STL coordinates) without exactly one reverse edge.
std::size_t open_edges(const std::string& stl) {
  std::map<std::pair<Place, Place>, int> edges;
  for (std::size_t at = 84; at < stl.size(); at += 50) {
    float v[9];
    std::memcpy(v, stl.data() + at + 12, sizeof v);
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3;
      ++edges[{{v[3 * i], v[3 * i + 1], v[3 * i + 2]}, {v[3 * j], v[3 * j + 1], v[3 * j + 2]}}];
    }
  }
  std::size_t open = 0;
  for (const auto& [edge, count] : edges) {
    const auto back = edges.find({edge.second, edge.first});
    open += count != 1 || back == edges.end() || back->second != 1;
  }
  return open;
}

TEST(SurfaceOf, BallIsClosedAndHasItsVolume) {
  const auto ball = surface_of([](const Eigen::Vector3d& p) { return p.norm() - 10; },
                               {Eigen::Vector3d::Constant(-12), Eigen::Vector3d::Constant(12)}, 0.7);
  EXPECT_EQ(open_edges(to_stl(ball)), 0u);
  EXPECT_NEAR(volume(ball), 4.0 / 3 * std::numbers::pi * 1000, 30);
}

TEST(SurfaceOf, CubeWithFacesOnTheGridIsClosed) {
  const auto cube = surface_of([](const Eigen::Vector3d& p) { return p.cwiseAbs().maxCoeff() - 5; },
                               {Eigen::Vector3d::Constant(-7), Eigen::Vector3d::Constant(7)}, 1);
  EXPECT_EQ(open_edges(to_stl(cube)), 0u);
  EXPECT_NEAR(volume(cube), 1000, 60);
}

TEST(ToStl, HasItsCountAndLength) {
  const TriangleMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
  const std::string stl = to_stl(mesh);
  ASSERT_EQ(stl.size(), 84u + 50u);
  EXPECT_EQ(stl[80], 1);
  float normal_z = 0;
  std::memcpy(&normal_z, stl.data() + 84 + 8, 4);
  EXPECT_EQ(normal_z, 1.0f);
}

TEST(PrintableBody, IsClosedAndOfPlausibleVolume) {
  BodyOptions options;
  options.step_mm = 2;
  const auto mesh = printable_body(udcsc(), options);
  ASSERT_TRUE(mesh.has_value());
  EXPECT_EQ(open_edges(to_stl(*mesh)), 0u);
  EXPECT_GT(volume(*mesh), 60e3);
  EXPECT_LT(volume(*mesh), 110e3);
}

TEST(PrintableBody, EveryBallFillsAPocketWithPlasticBelowAndAround) {
  const auto distance = body_distance(udcsc());
  for (const auto& ball : udcsc().balls) {
    const Eigen::Vector3d& centre = ball.centre_in_calibrator;
    const double azimuth = std::atan2(centre.y(), centre.x());
    const Eigen::Vector3d outward =
        Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), 30 / 87.5).normalized();
    const Eigen::Vector3d across(-std::sin(azimuth), std::cos(azimuth), 0);
    EXPECT_NEAR(distance(centre), 2, 1e-9) << ball.label;
    for (double out = 0; out < 8; out += 0.5) EXPECT_GT(distance(centre + out * outward), 1.9) << ball.label;
    EXPECT_LT(distance(centre - 2.7 * outward), -0.6) << ball.label;
    EXPECT_GT(distance(centre - 1.9 * outward), 0) << ball.label;
    for (const double side : {-1.0, 1.0}) {
      EXPECT_LT(distance(centre + side * 2.2 * across - 0.8 * outward), 0) << ball.label;
      EXPECT_GT(distance(centre + side * 1.9 * across), 0) << ball.label;
    }
  }
}

TEST(PrintableBody, GroovesAreCutBetweenTheirBalls) {
  const Calibrator calibrator = udcsc();
  const auto distance = body_distance(calibrator);
  const auto on_surface = [](double azimuth, double z, double depth) {
    const double radius = 60 - 30 / 87.5 * z - depth * std::hypot(1, 30 / 87.5);
    return Eigen::Vector3d(radius * std::cos(azimuth), radius * std::sin(azimuth), z);
  };
  const double column = std::numbers::pi * (1.0 / 6 + 1);
  EXPECT_GT(distance(on_surface(column, 27, 0.6)), 0.3);                        // P3-P7
  EXPECT_LT(distance(on_surface(column + std::numbers::pi / 16, 27, 0.6)), 0);  // beside it
  EXPECT_LT(distance(on_surface(column, 27, 1.5)), -0.3);                       // below it
  EXPECT_LT(distance(on_surface(column - std::numbers::pi, 15, 0.6)), 0);       // P1-P5 has none
}

TEST(PrintableBody, FacetsAreFlatAndRaised) {
  const auto distance = body_distance(udcsc());
  const double azimuth = std::numbers::pi * (1.0 / 6 + 0.25);
  const double slope = 30 / 87.5;
  const Eigen::Vector3d outward = Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), slope).normalized();
  const Eigen::Vector3d across(-std::sin(azimuth), std::cos(azimuth), 0);
  const Eigen::Vector3d centre(45 * std::cos(azimuth), 45 * std::sin(azimuth), 43.75);
  for (const double side : {-8.0, 0.0, 8.0})
    for (const double up : {-8.0, 0.0, 8.0}) {
      const Eigen::Vector3d place = centre + 0.8 * outward + side * across + up * outward.cross(across);
      EXPECT_NEAR(distance(place), 0, 1e-9);
      EXPECT_LT(distance(place - 0.3 * outward), 0);
      EXPECT_LT(distance(place - 2 * outward), 0);
    }
}

TEST(PrintableBody, BallOutsideTheConeIsRefused) {
  Calibrator calibrator = udcsc();
  calibrator.balls[2].centre_in_calibrator *= 0.5;
  EXPECT_EQ(printable_body(calibrator).error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::phantom
