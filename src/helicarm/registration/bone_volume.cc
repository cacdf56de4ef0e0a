// SPDX-License-Identifier: Apache-2.0
// The surface of a bone in a CT.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <Eigen/LU>

#include "helicarm/registration/bone_surface.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr float beside_bone_hu = 50, least_contrast_hu = 100;
constexpr double closed_gap_mm = 2;
// Averages the steps of a mask; a surface of 10 mm radius moves by 0.05 to 0.1 mm inwards.
constexpr double smoothing_voxels = 0.7, most_smoothing_mm = 1;
// Of a voxel: 0.29 (uniform) for one edge voxel, less over the neighbours that are averaged.
constexpr double edge_sigma_voxels = 0.2;

/// A box of the volume's voxels.
struct Grid {
  Vector3i size;
  std::vector<std::uint8_t> values;

  std::size_t index(const Vector3i& at) const {
    return std::size_t(at.x()) +
           std::size_t(size.x()) * (std::size_t(at.y()) + std::size_t(size.y()) * std::size_t(at.z()));
  }
  std::array<std::ptrdiff_t, 3> strides() const { return {1, size.x(), std::ptrdiff_t{size.x()} * size.y()}; }
  bool has(const Vector3i& at) const { return (at.array() >= 0).all() && (at.array() < size.array()).all(); }
  template <class Take>
  void each(const Take& take) const {
    for (int z = 0; z < size.z(); ++z)
      for (int y = 0; y < size.y(); ++y)
        for (int x = 0; x < size.x(); ++x) take(Vector3i(x, y, z));
  }
};

Grid grid_of(const Vector3i& size) {
  return {size, std::vector<std::uint8_t>(
                    std::size_t(size.x()) * std::size_t(size.y()) * std::size_t(size.z()), 0)};
}

/// Voxels that are reached from those in `queue` without crossing bone, along the axes; marks them.
void flood(const Grid& bone, Grid& reached, std::vector<Vector3i> queue, std::initializer_list<int> axes) {
  while (!queue.empty()) {
    const Vector3i at = queue.back();
    queue.pop_back();
    for (const int axis : axes)
      for (const int way : {-1, 1}) {
        Vector3i beside = at;
        beside[axis] += way;
        if (!bone.has(beside)) continue;
        const std::size_t i = bone.index(beside);
        if (bone.values[i] != 0 || reached.values[i] != 0) continue;
        reached.values[i] = 1;
        queue.push_back(beside);
      }
  }
}

/// Fills what the grid's surroundings do not reach. On the grid's faces, where the bone may be cut off, a
/// cavity is what the face's own edges do not reach.
void fill_cavities(Grid& bone) {
  Grid reached = grid_of(bone.size);
  for (int axis = 0; axis < 3; ++axis) {
    const int p = (axis + 1) % 3, q = (axis + 2) % 3;
    for (const int face : {0, bone.size[axis] - 1}) {
      std::vector<Vector3i> edges;
      for (int i = 0; i < bone.size[p]; ++i)
        for (int j = 0; j < bone.size[q]; ++j) {
          if (i > 0 && i + 1 < bone.size[p] && j > 0 && j + 1 < bone.size[q]) continue;
          Vector3i at;
          at[axis] = face, at[p] = i, at[q] = j;
          if (bone.values[bone.index(at)] != 0) continue;
          reached.values[bone.index(at)] = 1;
          edges.push_back(at);
        }
      flood(bone, reached, std::move(edges), {p, q});
    }
  }
  std::vector<Vector3i> faces;
  bone.each([&](const Vector3i& at) {
    if (reached.values[bone.index(at)] != 0) faces.push_back(at);
  });
  flood(bone, reached, std::move(faces), {0, 1, 2});
  for (std::size_t i = 0; i < bone.values.size(); ++i) bone.values[i] = reached.values[i] == 0;
}

/// The largest (or least) value within `reach` voxels along each axis.
Grid extreme(Grid grid, const Vector3i& reach, bool largest) {
  for (int axis = 0; axis < 3; ++axis) {
    Grid next = grid;
    const std::ptrdiff_t stride = grid.strides()[std::size_t(axis)];
    grid.each([&](const Vector3i& at) {
      const std::size_t i = grid.index(at);
      std::uint8_t value = grid.values[i];
      for (int step = std::max(-reach[axis], -at[axis]);
           step <= std::min(reach[axis], grid.size[axis] - 1 - at[axis]); ++step) {
        const std::uint8_t other = grid.values[std::size_t(std::ptrdiff_t(i) + step * stride)];
        value = largest ? std::max(value, other) : std::min(value, other);
      }
      next.values[i] = value;
    });
    grid = std::move(next);
  }
  return grid;
}

void close_gaps(Grid& bone, const Vector3d& spacing) {
  const Vector3i reach = (0.5 * closed_gap_mm / spacing.array()).round().cast<int>();
  Grid closed = extreme(bone, reach, true);
  fill_cavities(closed);
  closed = extreme(std::move(closed), reach, false);
  for (std::size_t i = 0; i < bone.values.size(); ++i) bone.values[i] |= closed.values[i];
}

/// The share (of 255) of each voxel that the bone fills, from the CT where it shows the edge.
Grid filled_shares(const Grid& bone, const std::vector<float>& hu) {
  Grid shares = grid_of(bone.size);
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

void smooth(Grid& grid, const Vector3d& spacing, double sigma_mm) {
  for (int axis = 0; axis < 3; ++axis) {
    const double sigma = sigma_mm / spacing[axis];
    const int reach = int(std::ceil(3 * sigma));
    std::vector<float> weights;
    float sum = 0;
    for (int k = -reach; k <= reach; ++k)
      sum += weights.emplace_back(static_cast<float>(std::exp(-0.5 * k * k / (sigma * sigma))));
    const std::ptrdiff_t stride = grid.strides()[std::size_t(axis)];
    Grid next = grid;
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

class BoneVolume final : public BoneSurface {
 public:
  BoneVolume(Grid shares, const Eigen::Affine3d& model_from_voxel)
      : shares_(std::move(shares)),
        voxel_from_model_(model_from_voxel.inverse()),
        model_from_voxel_(model_from_voxel.linear()),
        step_mm_(0.4 * model_from_voxel.linear().colwise().norm().minCoeff()) {}

  std::vector<Crossing> crossings(const Vector3d& origin, const Vector3d& direction, double length_mm,
                                  std::size_t most) const override {
    std::vector<Crossing> found;
    const int steps = std::max(1, int(std::ceil(length_mm / step_mm_)));
    const double step = length_mm / steps;
    double before = excess(origin);
    for (int k = 1; k <= steps && found.size() < most; ++k) {
      const double now = excess(origin + k * step * direction);
      if ((now > 0) != (before > 0)) {
        const double at = (k - 1 + before / (before - now)) * step;
        found.push_back({at, normal(origin + at * direction), before > 0});
      }
      before = now;
    }
    return found;
  }
  bool holds(const Vector3d& point) const override { return excess(point) > 0; }
  double sigma_mm(const Vector3d& along) const override {
    // The voxel's width along the normal, as that of an ellipsoid.
    return edge_sigma_voxels * (model_from_voxel_.transpose() * along).norm();
  }

 private:
  /// Over the level of the surface, in model coordinates; beyond the grid as on its face.
  double excess(const Vector3d& point) const {
    const Vector3d at = voxel_from_model_ * point;
    Vector3i low;
    Vector3d part;
    for (int axis = 0; axis < 3; ++axis) {
      const double inside = std::clamp(at[axis], 0.0, double(shares_.size[axis] - 1));
      low[axis] = std::min(int(inside), std::max(0, shares_.size[axis] - 2));
      part[axis] = inside - low[axis];
    }
    double value = 0;
    for (int corner = 0; corner < 8; ++corner) {
      Vector3i voxel = low;
      double weight = 1;
      for (int axis = 0; axis < 3; ++axis) {
        const bool upper = (corner >> axis & 1) != 0;
        weight *= upper ? part[axis] : 1 - part[axis];
        voxel[axis] = std::min(voxel[axis] + upper, shares_.size[axis] - 1);
      }
      value += weight * shares_.values[shares_.index(voxel)];
    }
    return value - 127.5;
  }

  Vector3d normal(const Vector3d& point) const {
    Vector3d rise;
    const double reach = 1.25 * step_mm_;
    for (int axis = 0; axis < 3; ++axis)
      rise[axis] =
          excess(point + reach * Vector3d::Unit(axis)) - excess(point - reach * Vector3d::Unit(axis));
    return rise.norm() > 0 ? Vector3d(-rise.normalized()) : Vector3d::UnitZ();
  }

  Grid shares_;
  Eigen::Affine3d voxel_from_model_;
  Eigen::Matrix3d model_from_voxel_;
  double step_mm_;
};

}  // namespace

std::shared_ptr<const BoneSurface> bone_surface(const volume::Volume& volume,
                                                const std::optional<volume::Volume>& mask,
                                                const std::optional<HuWindow>& window) {
  const auto is_bone = [&](std::size_t i) {
    return mask ? mask->voxels[i] != 0 : double(volume.voxels[i]) >= window->low;
  };
  const Vector3d spacing = volume.patient_from_voxel.linear().colwise().norm();
  const double sigma_mm = std::min(most_smoothing_mm, smoothing_voxels * spacing.maxCoeff());
  const Grid whole{volume.size, {}};
  Vector3i low = volume.size, high = Vector3i::Zero();
  whole.each([&](const Vector3i& at) {
    if (is_bone(whole.index(at))) low = low.cwiseMin(at), high = high.cwiseMax(at);
  });
  if (low.x() > high.x()) return nullptr;
  const Vector3i margin =
      (3 * sigma_mm / spacing.array() + closed_gap_mm / spacing.array()).ceil().cast<int>() + 2;
  low = (low - margin).cwiseMax(0);
  high = (high + margin).cwiseMin(volume.size - Vector3i::Ones());
  Grid bone = grid_of(high - low + Vector3i::Ones());
  std::vector<float> hu(bone.values.size());
  bone.each([&](const Vector3i& at) {
    const std::size_t from = whole.index(at + low), to = bone.index(at);
    bone.values[to] = is_bone(from);
    hu[to] = volume.voxels[from];
  });
  if (!mask) close_gaps(bone, spacing);
  fill_cavities(bone);
  Grid shares = filled_shares(bone, hu);
  smooth(shares, spacing, sigma_mm);
  return std::make_shared<const BoneVolume>(
      std::move(shares), volume.patient_from_voxel * Eigen::Translation3d(low.cast<double>()));
}

}  // namespace helicarm::registration
