// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/simplify.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include <gtest/gtest.h>

#include "helicarm/phantom/body.h"

namespace helicarm::phantom {
namespace {

constexpr double tolerance_mm = 0.02;

bool is_closed(const TriangleMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
  return std::ranges::all_of(edges, [&](const auto& edge) {
    const auto back = edges.find({edge.first.second, edge.first.first});
    return edge.second == 1 && back != edges.end();
  });
}

/// Largest distance of the triangles' corners, centres and edges' middles from the surface.
double deviation(const TriangleMesh& mesh, const SignedDistance& distance) {
  double largest = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3d &p = mesh.corners[a], &q = mesh.corners[b], &r = mesh.corners[c];
    for (const Eigen::Vector3d& at :
         {p, Eigen::Vector3d((p + q) / 2), Eigen::Vector3d((q + r) / 2), Eigen::Vector3d((p + q + r) / 3)})
      largest = std::max(largest, std::abs(distance(at)));
  }
  return largest;
}

TriangleMesh cube_of(const Eigen::Vector3d& half, double step) {
  const auto distance = [=](const Eigen::Vector3d& p) { return (p.cwiseAbs() - half).maxCoeff(); };
  const Eigen::Vector3d reach = half.array() + 2 * step;
  return surface_of(distance, {-reach, reach}, step);
}

TEST(Simplified, BallStaysWithinTheToleranceWithAFractionOfTheTriangles) {
  const SignedDistance distance = [](const Eigen::Vector3d& p) { return p.norm() - 10; };
  const auto ball =
      surface_of(distance, {Eigen::Vector3d::Constant(-12), Eigen::Vector3d::Constant(12)}, 0.3);
  const auto fewer = simplified(ball, tolerance_mm);
  EXPECT_TRUE(is_closed(fewer));
  EXPECT_LT(fewer.triangles.size(), ball.triangles.size() / 8);
  EXPECT_LT(deviation(fewer, distance), 2 * tolerance_mm);
  EXPECT_NEAR(volume(fewer), volume(ball), 4 * std::numbers::pi * 100 * tolerance_mm);
}

TEST(Simplified, PlaneFacesKeepFewTriangles) {
  const auto cube = cube_of({5, 6, 7}, 0.53);
  const auto fewer = simplified(cube, tolerance_mm);
  EXPECT_TRUE(is_closed(fewer));
  EXPECT_LT(fewer.triangles.size(), cube.triangles.size() / 4);
  EXPECT_NEAR(volume(fewer), volume(cube), 1e-3 * volume(cube));
}

TEST(Simplified, ThinSheetKeepsItsThickness) {
  const auto sheet = cube_of({10, 10, 0.4}, 0.37);
  const auto fewer = simplified(sheet, tolerance_mm);
  EXPECT_TRUE(is_closed(fewer));
  EXPECT_NEAR(volume(fewer), volume(sheet), 5e-3 * volume(sheet));
  for (const auto& corner : fewer.corners) EXPECT_NEAR(std::abs(corner.z()), 0.4, 0.4);
}

TEST(Simplified, TetrahedronStaysAsItIs) {
  const TriangleMesh given{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
                           {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}}};
  EXPECT_EQ(simplified(given, 10).triangles.size(), 4u);
}

TEST(Simplified, PrintableBodyIsClosedAndNoFurtherFromItsShapeThanTheGrid) {
  BodyOptions options;
  options.step_mm = 1.5;
  const auto body = printable_body(udcsc(), options);
  ASSERT_TRUE(body) << body.error().message;
  EXPECT_TRUE(is_closed(*body));
  EXPECT_LT(body->triangles.size(), 60000u);
  const auto distance = body_distance(udcsc(), options);
  // The grid cuts sharp edges by up to its step; simplifying adds its tolerance.
  EXPECT_LT(deviation(*body, distance), options.step_mm);
}

}  // namespace
}  // namespace helicarm::phantom
