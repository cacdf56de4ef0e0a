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

/// The closed surface of balls that overlap.
inline phantom::TriangleMesh surface_of_balls(const std::vector<Ball>& balls) {
  return phantom::surface_of(
      [&](const Eigen::Vector3d& p) {
        double nearest = 1e9;
        for (const Ball& ball : balls) nearest = std::min(nearest, (p - ball.centre).norm() - ball.radius);
        return nearest;
      },
      {Eigen::Vector3d(-24, -24, -24), Eigen::Vector3d(26, 26, 26)}, 1.0);
}

/// Its mirror image is another body.
inline phantom::TriangleMesh lopsided_surface() {
  return surface_of_balls({{{0, 0, 0}, 14}, {{12, 5, 10}, 9}, {{-6, 12, -9}, 8}, {{-11, -8, 4}, 9}});
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
