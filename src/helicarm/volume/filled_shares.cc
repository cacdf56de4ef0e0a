// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/filled_shares.h"

#include <algorithm>
#include <cmath>

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr float beside_bone_hu = 50, least_contrast_hu = 100;
// A surface of 10 mm radius moves by 0.05 to 0.1 mm inwards.
constexpr double smoothing_voxels = 0.7, most_smoothing_mm = 1;

}  // namespace

ByteGrid byte_grid(const Vector3i& size) {
  return {size, std::vector<std::uint8_t>(
                    std::size_t(size.x()) * std::size_t(size.y()) * std::size_t(size.z()), 0)};
}

ByteGrid filled_shares(const ByteGrid& bone, const std::vector<float>& hu) {
  ByteGrid shares = byte_grid(bone.size);
  bone.each([&](const Vector3i& at) {
    const std::size_t i = bone.index(at);
    const bool inside = bone.values[i] != 0;
    shares.values[i] = inside ? 255 : 0;
    float inner = beside_bone_hu;
    bool on_edge = false;
    for (int axis = 0; axis < 3; ++axis)
      for (const int way : {-1, 1}) {
        Vector3i beside = at;
        beside[axis] += way;
        if (!bone.has(beside)) continue;
        const std::size_t k = bone.index(beside);
        on_edge = on_edge || (bone.values[k] != 0) != inside;
        if (bone.values[k] != 0) inner = std::max(inner, hu[k]);
      }
    if (!on_edge || inner - beside_bone_hu < least_contrast_hu) return;
    const float share = std::clamp((hu[i] - beside_bone_hu) / (inner - beside_bone_hu), 0.0F,
                                   inside ? 1.0F : 0.5F);  // outside: another bone may touch this one
    shares.values[i] = static_cast<std::uint8_t>(std::lround(255 * share));
  });
  return shares;
}

double share_smoothing_mm(const Vector3d& spacing) {
  return std::min(most_smoothing_mm, smoothing_voxels * spacing.maxCoeff());
}

void smooth(ByteGrid& grid, const Vector3d& spacing, double sigma_mm) {
  for (int axis = 0; axis < 3; ++axis) {
    const double sigma = sigma_mm / spacing[axis];
    const int reach = int(std::ceil(3 * sigma));
    std::vector<float> weights;
    float sum = 0;
    for (int k = -reach; k <= reach; ++k)
      sum += weights.emplace_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma))));
    const std::ptrdiff_t stride = grid.strides()[std::size_t(axis)];
    ByteGrid next = grid;
    grid.each([&](const Vector3i& at) {
      const std::size_t i = grid.index(at);
      float value = 0;
      for (int k = -reach; k <= reach; ++k) {
        const int within = std::clamp(at[axis] + k, 0, grid.size[axis] - 1) - at[axis];
        value += weights[std::size_t(k + reach)] *
                 static_cast<float>(grid.values[std::size_t(std::ptrdiff_t(i) + within * stride)]);
      }
      next.values[i] = static_cast<std::uint8_t>(std::lround(value / sum));
    });
    grid = std::move(next);
  }
}

}  // namespace helicarm::volume
