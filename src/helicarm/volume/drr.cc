// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/drr.h"

#include <algorithm>
#include <array>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/core/parallel.h"

namespace helicarm::volume {

Expected<image::Image<float>> drr(const Absorber& absorber, const geometry::View& view, int width, int height,
                                  unsigned threads) {
  const Eigen::Vector3d source = view.source_in_world();
  if (absorber.contains(source))
    return fail(Reason::bad_value,
                fmt::format("the source, at {:.6g}, {:.6g}, {:.6g} mm, lies inside the volume", source.x(),
                            source.y(), source.z()));
  const Eigen::Matrix3d world_from_pixel =
      view.camera_from_world.rotation.transpose() * view.intrinsics.matrix().inverse();
  image::Image<float> integrals(width, height);
  // A tile's rays share the voxels in the L2 cache.
  constexpr int tile = 64;
  const int across = (width + tile - 1) / tile;
  const int down = (height + tile - 1) / tile;
  parallel_for(
      static_cast<std::size_t>(across) * static_cast<std::size_t>(down), threads, [&](std::size_t number) {
        const int u0 = static_cast<int>(number) % across * tile;
        const int v0 = static_cast<int>(number) / across * tile;
        const int count = std::min(tile, width - u0);
        std::array<Eigen::Vector3d, tile> directions;
        for (int v = v0; v < std::min(v0 + tile, height); ++v) {
          for (int i = 0; i < count; ++i)
            directions[static_cast<std::size_t>(i)] = world_from_pixel * Eigen::Vector3d(u0 + i, v, 1);
          const auto rays = static_cast<std::size_t>(count);
          absorber.integrate(source, {directions.data(), rays}, {integrals.row(v) + u0, rays});
        }
      });
  return integrals;
}

}  // namespace helicarm::volume
