// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/voxel_surface.h"

#include <cmath>

#include <gtest/gtest.h>

#include "helicarm/registration/surface_scene_test.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;

constexpr double ball_mm = 18;

/// A ball as a mask of 1 mm voxels shows it.
Surface stepped_ball() {
  const auto mask = [](const Vector3d& p) {
    return Vector3d(p.array().round()).norm() < ball_mm ? -1.0 : 1.0;
  };
  return *prepare_surface(
      phantom::surface_of(mask, {Vector3d(-22.3, -22.3, -22.3), Vector3d(22.3, 22.3, 22.3)}, 1.0), "ball");
}

Surface smooth_ball() {
  return *prepare_surface(
      phantom::surface_of([](const Vector3d& p) { return p.norm() - ball_mm; },
                          {Vector3d(-22.3, -22.3, -22.3), Vector3d(22.3, 22.3, 22.3)}, 1.0),
      "ball");
}

/// Mean angle (degrees) between the faces' normals and the ball's, and the mean radius.
std::pair<double, double> roughness_and_radius(const Surface& surface) {
  double angle = 0, radius = 0, area = 0;
  for (std::size_t i = 0; i < surface.normals.size(); ++i) {
    const auto& t = surface.mesh.triangles[i];
    const auto& c = surface.mesh.corners;
    const Vector3d middle = (c[t[0]] + c[t[1]] + c[t[2]]) / 3;
    const double size = (c[t[1]] - c[t[0]]).cross(c[t[2]] - c[t[0]]).norm();
    if (size == 0) continue;
    angle += size * std::acos(std::clamp(surface.normals[i].dot(middle.normalized()), -1.0, 1.0));
    radius += size * middle.norm();
    area += size;
  }
  return {angle / area * 180 / EIGEN_PI, radius / area};
}

TEST(VoxelSurface, StepsAreSmoothedWithoutShrinking) {
  Surface ball = stepped_ball();
  ASSERT_GT(voxel_size_mm(ball), 0);
  const auto [rough, radius] = roughness_and_radius(ball);
  smooth_steps(ball, voxel_size_mm(ball));
  const auto [smoothed, radius_after] = roughness_and_radius(ball);
  EXPECT_LT(smoothed, 0.5 * rough);
  EXPECT_NEAR(radius_after, radius, 0.2);
}

TEST(VoxelSurface, ASmoothSurfaceHasNone) {
  Surface ball = smooth_ball();
  const auto before = ball.mesh.corners;
  smooth_steps(ball, voxel_size_mm(ball));
  EXPECT_EQ(ball.mesh.corners, before);
}

TEST(VoxelSurface, FewTrianglesAreADesignedSurface) {
  Surface few = stepped_ball();
  few.mesh.triangles.resize(1000);
  EXPECT_EQ(voxel_size_mm(few), 0);
}

TEST(VoxelSurface, UnequalEdgesAreADesignedSurface) {
  Surface stretched = smooth_ball();
  for (Vector3d& corner : stretched.mesh.corners)
    if (corner.z() > 8) corner.z() += 20 * (corner.z() - 8);
  EXPECT_EQ(voxel_size_mm(stretched), 0);
}

TEST(VoxelSurface, TheSizeIsAVoxel) {
  EXPECT_GT(voxel_size_mm(stepped_ball()), 0.6);
  EXPECT_LE(voxel_size_mm(stepped_ball()), 1);
}

}  // namespace
}  // namespace helicarm::registration
