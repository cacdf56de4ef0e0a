// SPDX-License-Identifier: Apache-2.0
// The surface of a bone in a CT.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include <Eigen/LU>

#include "helicarm/registration/bone_surface.h"
#include "helicarm/volume/bone_edge.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;
using volume::ByteGrid;

constexpr double closed_gap_mm = 2;

/// Voxels that are reached from those in `queue` without crossing bone, along the axes; marks them.
void flood(const ByteGrid& bone, ByteGrid& reached, std::vector<Vector3i> queue,
           std::initializer_list<int> axes) {
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
void fill_cavities(ByteGrid& bone) {
  ByteGrid reached = volume::byte_grid(bone.size);
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
ByteGrid extreme(ByteGrid grid, const Vector3i& reach, bool largest) {
  for (int axis = 0; axis < 3; ++axis) {
    ByteGrid next = grid;
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

/// With a frame of this many voxels that continue those on its faces.
ByteGrid framed(const ByteGrid& grid, const Vector3i& frame) {
  ByteGrid larger = volume::byte_grid(grid.size + 2 * frame);
  std::size_t i = 0;
  larger.each([&](const Vector3i& at) {
    const Vector3i within = (at - frame).cwiseMax(0).cwiseMin(grid.size - Vector3i::Ones());
    larger.values[i++] = grid.values[grid.index(within)];
  });
  return larger;
}

void close_gaps(ByteGrid& bone, const Vector3d& spacing) {
  const Vector3i reach = (0.5 * closed_gap_mm / spacing.array()).round().cast<int>();
  // What grows as far as a face without going on there is to shrink from it again.
  ByteGrid closed = extreme(framed(bone, reach), reach, true);
  fill_cavities(closed);
  closed = extreme(std::move(closed), reach, false);
  std::size_t i = 0;
  bone.each([&](const Vector3i& at) { bone.values[i++] |= closed.values[closed.index(at + reach)]; });
}

class BoneVolume final : public BoneSurface {
 public:
  BoneVolume(volume::BoneEdge edge, const Eigen::Affine3d& model_from_voxel)
      : edge_(std::move(edge)),
        voxel_from_model_(model_from_voxel.inverse()),
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
        const Vector3d place = origin + at * direction;
        if (shows(place)) found.push_back({at, normal(place), before > 0});
      }
      before = now;
    }
    return found;
  }
  bool holds(const Vector3d& point) const override { return excess(point) > 0; }
  bool shows(const Vector3d& point) const override {
    const Eigen::Array3d voxel = (voxel_from_model_ * point).array();
    return (voxel >= -0.5).all() && (voxel <= edge_.inside.size.cast<double>().array() - 0.5).all();
  }
  double sigma_mm(const Vector3d& point) const override { return edge_.sigma_mm(voxel_from_model_ * point); }

 private:
  double excess(const Vector3d& point) const { return edge_.excess(voxel_from_model_ * point); }

  Vector3d normal(const Vector3d& point) const {
    Vector3d rise;
    const double reach = 1.25 * step_mm_;
    for (int axis = 0; axis < 3; ++axis)
      rise[axis] =
          excess(point + reach * Vector3d::Unit(axis)) - excess(point - reach * Vector3d::Unit(axis));
    return rise.norm() > 0 ? Vector3d(-rise.normalized()) : Vector3d::UnitZ();
  }

  volume::BoneEdge edge_;
  Eigen::Affine3d voxel_from_model_;
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
  const ByteGrid whole{volume.size, {}};
  Vector3i low = volume.size, high = Vector3i::Zero();
  whole.each([&](const Vector3i& at) {
    if (is_bone(whole.index(at))) low = low.cwiseMin(at), high = high.cwiseMax(at);
  });
  if (low.x() > high.x()) return nullptr;
  const Eigen::Matrix3d& mm_from_voxel = volume.patient_from_voxel.linear();
  const Vector3i margin =
      volume::bone_edge_margin(mm_from_voxel) + (closed_gap_mm / spacing.array()).ceil().cast<int>().matrix();
  low = (low - margin).cwiseMax(0);
  high = (high + margin).cwiseMin(volume.size - Vector3i::Ones());
  ByteGrid bone = volume::byte_grid(high - low + Vector3i::Ones());
  std::vector<float> hu(bone.values.size());
  bone.each([&](const Vector3i& at) {
    const std::size_t from = whole.index(at + low), to = bone.index(at);
    bone.values[to] = is_bone(from);
    hu[to] = volume.voxels[from];
  });
  if (!mask) close_gaps(bone, spacing);
  fill_cavities(bone);
  return std::make_shared<const BoneVolume>(
      volume::bone_edge(bone, hu, mm_from_voxel),
      volume.patient_from_voxel * Eigen::Translation3d(low.cast<double>()));
}

}  // namespace helicarm::registration
