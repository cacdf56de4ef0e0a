// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/bone_mesh.h"

#include <map>

#include <gtest/gtest.h>

#include "helicarm/registration/surface.h"
#include "helicarm/segmentation/scene_test.h"

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3d;

std::size_t open_edges_of(const phantom::TriangleMesh& mesh) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  for (const auto& triangle : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = triangle[k], b = triangle[(k + 1) % 3];
      edges[std::minmax(a, b)] += a < b ? 1 : -1;
    }
  std::size_t open = 0;
  for (const auto& [edge, sum] : edges) open += sum != 0;
  return open;
}

TEST(BoneMesh, LiesAtTheCortexBetweenTheVoxels) {
  const TestCt ct =
      ct_of({upper}, {1, 0.9, 1.3}, geometry::rotation_from_vector({0.1, 0.4, 0.2}), {24, 24, 50});
  const auto made = segment(ct.volume, std::vector<Seed>{{"upper", {0, 0, 46}}}, {});
  ASSERT_TRUE(made) << made.error().message;
  const phantom::TriangleMesh mesh = surface_of(ct.volume, *made, made->bones[0]);
  EXPECT_EQ(open_edges_of(mesh), 0U);
  EXPECT_NEAR(phantom::volume(mesh) / 1000, upper.volume_cm3(), 0.03 * upper.volume_cm3());
  double squares = 0, sum = 0;
  for (const Vector3d& corner : mesh.corners) squares += std::pow(upper(corner), 2), sum += upper(corner);
  EXPECT_LT(std::sqrt(squares / double(mesh.corners.size())), 0.25);
  EXPECT_NEAR(sum / double(mesh.corners.size()), 0, 0.15);
  // Of the ellipsoid, by Thomsen's approximation: 4 pi ((ab)^p + (ac)^p + (bc)^p) / 3)^(1/p), p = 1.6075.
  EXPECT_NEAR(area_cm2(mesh), 42.0, 1.0);
}

TEST(BoneMesh, IsClosedWhereTheVolumeCutsTheBoneOff) {
  const TestBone shaft{{0, 0, -40}, {13, 12, 90}};
  const TestCt ct = ct_of({shaft}, {1, 1, 1}, Eigen::Matrix3d::Identity(), {20, 20, 30});
  const auto made = segment(ct.volume, std::vector<Seed>{{"shaft", {0, 0, 10}}}, {});
  ASSERT_TRUE(made);
  const phantom::TriangleMesh mesh = surface_of(ct.volume, *made, made->bones[0]);
  EXPECT_EQ(open_edges_of(mesh), 0U);
  Eigen::AlignedBox3d box;
  for (const Vector3d& corner : mesh.corners) box.extend(corner);
  EXPECT_NEAR(box.sizes().z(), 61, 0.1);
}

TEST(BoneMesh, AsStlStatesSpaceAndUnit) {
  const TestCt ct = ct_of({upper}, {1, 1, 1}, Eigen::Matrix3d::Identity(), {24, 24, 50});
  const auto made = segment(ct.volume, std::vector<Seed>{{"upper", {0, 0, 46}}}, {});
  ASSERT_TRUE(made);
  const std::string stl = stl_in_lps(surface_of(ct.volume, *made, made->bones[0]));
  const auto read = registration::surface_from(stl, "upper.stl");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_TRUE(read->warnings.empty());
  EXPECT_EQ(stl.substr(0, 18), "SPACE=LPS UNITS=mm");
  EXPECT_TRUE(registration::prepare_surface(*read, "upper.stl"));
}

}  // namespace
}  // namespace helicarm::segmentation
