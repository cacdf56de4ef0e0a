// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/surface.h"

#include <gmock/gmock.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/registration/contour.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

phantom::TriangleMesh ball(const Vector3d& centre, double radius) {
  const Vector3d reach = Vector3d::Constant(radius + 2);
  return phantom::surface_of([&](const Vector3d& p) { return (p - centre).norm() - radius; },
                             {centre - reach, centre + reach}, 0.8);
}

constexpr const char* tetrahedron_stl =
    "solid t\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 1 0\nvertex 1 0 0\nendloop\nendfacet\n"
    "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 0 1\nendloop\nendfacet\n"
    "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 1\nvertex 0 1 0\nendloop\nendfacet\n"
    "facet normal 0 0 0\nouter loop\nvertex 1 0 0\nvertex 0 1 0\nvertex 0 0 1\nendloop\nendfacet\nendsolid "
    "t\n";

TEST(ReadSurface, BinaryStlJoinsCorners) {
  const auto mesh = ball({1, 2, 3}, 5);
  const auto read = surface_from(phantom::to_stl(mesh), "ball.stl");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->triangles.size(), mesh.triangles.size());
  EXPECT_NEAR(phantom::volume(*read), phantom::volume(mesh), 1e-3 * phantom::volume(mesh));
  EXPECT_LE(read->corners.size(), mesh.corners.size());
}

TEST(ReadSurface, TextStl) {
  const auto read = surface_from(tetrahedron_stl, "t.stl");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->triangles.size(), 4u);
  EXPECT_EQ(read->corners.size(), 4u);
}

TEST(ReadSurface, TextPly) {
  const auto read = surface_from(
      "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float "
      "y\nproperty "
      "float z\nelement face 4\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 "
      "1\n3 0 2 "
      "1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n",
      "t.ply");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->triangles.size(), 4u);
  EXPECT_NEAR(phantom::volume(*read), 1.0 / 6, 1e-9);
}

TEST(ReadSurface, RefusesACutFile) {
  const std::string whole = phantom::to_stl(ball({0, 0, 0}, 4));
  const auto read = surface_from(std::string_view(whole).substr(0, whole.size() - 20), "cut.stl");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().reason, Reason::truncated);
}

TEST(ReadSurface, RefusesAVertexThatIsNone) {
  const auto read = surface_from(
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
      "z\nelement face 1\n"
      "property list uchar int vertex_indices\nend_header\n0 0 0\n3 0 1 2\n",
      "t.ply");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().reason, Reason::bad_value);
}

TEST(PrepareSurface, RefusesAnOpenOne) {
  auto mesh = ball({0, 0, 0}, 4);
  mesh.triangles.resize(mesh.triangles.size() / 2);
  const auto surface = prepare_surface(mesh, "half");
  ASSERT_FALSE(surface);
  EXPECT_EQ(surface.error().reason, Reason::bad_value);
}

TEST(PrepareSurface, TurnsAnInsideOutOne) {
  auto mesh = ball({0, 0, 0}, 4);
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  const auto surface = prepare_surface(mesh, "ball");
  ASSERT_TRUE(surface);
  EXPECT_GT(phantom::volume(surface->mesh), 0);
}

class ContourOfABall : public testing::TestWithParam<double> {};

TEST_P(ContourOfABall, IsItsCircleWithOutwardNormals) {
  const auto surface = prepare_surface(ball({0, 0, 0}, 20), "ball");
  ASSERT_TRUE(surface);
  geometry::View view;
  view.intrinsics = {GetParam(), 3000, 512, 512, 0};  // fx < 0: a mirrored image
  view.camera_from_world.translation = {0, 0, 900};
  const auto contour = apparent_contour(*surface, view, {}, 4);
  ASSERT_GT(contour.size(), 60u);
  const double radius = 3000 * 20 / std::sqrt(900.0 * 900 - 400);
  for (const ContourPoint& point : contour) {
    const Vector2d arm = point.pixel - Vector2d(512, 512);
    EXPECT_NEAR(arm.norm(), radius, 0.3);
    EXPECT_GT(arm.normalized().dot(point.normal), 0.98);
  }
}

INSTANTIATE_TEST_SUITE_P(PlainAndMirrored, ContourOfABall, testing::Values(3000, -3000));

}  // namespace
}  // namespace helicarm::registration
