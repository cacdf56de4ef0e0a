// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

#include "helicarm/phantom/mesh.h"
#include "helicarm/registration/scene_test.h"

namespace helicarm::registration {

struct Ball {
  Eigen::Vector3d centre;
  double radius;
};

/// Signed, to the nearest ball.
inline double distance_to(const std::vector<Ball>& balls, const Eigen::Vector3d& p) {
  double nearest = 1e9;
  for (const Ball& ball : balls) nearest = std::min(nearest, (p - ball.centre).norm() - ball.radius);
  return nearest;
}

/// The closed surface of balls that overlap.
inline phantom::TriangleMesh surface_of_balls(const std::vector<Ball>& balls) {
  return phantom::surface_of([&](const Eigen::Vector3d& p) { return distance_to(balls, p); },
                             {Eigen::Vector3d(-24, -24, -24), Eigen::Vector3d(26, 26, 26)}, 1.0);
}

inline const std::vector<Ball> lopsided_balls = {
    {{0, 0, 0}, 14}, {{12, 5, 10}, 9}, {{-6, 12, -9}, 8}, {{-11, -8, 4}, 9}};

/// Its mirror image is another body.
inline phantom::TriangleMesh lopsided_surface() { return surface_of_balls(lopsided_balls); }

/// The same body as the surface of its mask of 0.8 mm voxels, grown by one.
inline phantom::TriangleMesh stepped_surface() {
  constexpr double voxel_mm = 0.8;
  return phantom::surface_of(
      [&](const Eigen::Vector3d& p) {
        return distance_to(lopsided_balls, voxel_mm * (p / voxel_mm).array().round().matrix()) < voxel_mm
                   ? -1.0
                   : 1.0;
      },
      {Eigen::Vector3d(-26, -26, -26), Eigen::Vector3d(28, 28, 28)}, voxel_mm);
}

/// Its own mirror image, in the plane of the three centres.
inline phantom::TriangleMesh symmetric_surface() {
  return surface_of_balls({{{0, 0, 0}, 14}, {{12, 5, 10}, 9}, {{-6, 12, -9}, 8}});
}

/// Metal: its density at the surface, filled and drawn by the exact renderer.
inline volume::Volume filled_volume(const Model& model) {
  volume::Volume volume{model.density.size, model.density.values, model.density.model_from_voxel, {}};
  for (float& voxel : volume.voxels) voxel = voxel > 0 ? 3000.0F : -1024.0F;
  return volume;
}

}  // namespace helicarm::registration
