// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/density.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

namespace helicarm::registration {

using Eigen::Vector3d;
using Eigen::Vector3i;

Density coarser(const Density& density, double voxel_mm) {
  const Vector3d spacing = density.model_from_voxel.linear().colwise().norm();
  Vector3i factor;
  for (int axis = 0; axis < 3; ++axis)
    factor[axis] = std::max(1, static_cast<int>(std::lround(voxel_mm / spacing[axis])));
  if (factor == Vector3i::Ones()) return density;
  Density coarse;
  // One voxel of zeros on each side.
  for (int axis = 0; axis < 3; ++axis)
    coarse.size[axis] = (density.size[axis] + factor[axis] - 1) / factor[axis] + 2;
  const Vector3d scale = factor.cast<double>();
  const Vector3d first = 0.5 * (scale - Vector3d::Ones()) - scale;
  coarse.hardening = density.hardening;
  coarse.model_from_voxel = density.model_from_voxel * Eigen::Translation3d(first) * Eigen::Scaling(scale);
  coarse.values.assign(static_cast<std::size_t>(coarse.size.x()) * static_cast<std::size_t>(coarse.size.y()) *
                           static_cast<std::size_t>(coarse.size.z()),
                       0.0F);
  for (int z = 0; z < density.size.z(); ++z)
    for (int y = 0; y < density.size.y(); ++y)
      for (int x = 0; x < density.size.x(); ++x)
        coarse.values[coarse.index(x / factor.x() + 1, y / factor.y() + 1, z / factor.z() + 1)] +=
            density.values[density.index(x, y, z)];
  const auto share = static_cast<float>(1 / scale.prod());
  for (float& value : coarse.values) value *= share;
  return coarse;
}

void mark_blocks(Density& density) {
  constexpr int side = Density::block;
  const Vector3i count = density.blocks();
  density.occupied.assign(std::size_t(count.prod()), 0);
  const auto mark = [&](int x, int y, int z) {
    const Eigen::Index block = x + Eigen::Index{count.x()} * (y + Eigen::Index{count.y()} * z);
    density.occupied[std::size_t(block)] = 1;
  };
  for (int z = 0; z < density.size.z(); ++z)
    for (int y = 0; y < density.size.y(); ++y)
      for (int x = 0; x < density.size.x(); ++x) {
        if (density.values[density.index(x, y, z)] == 0) continue;
        // A voxel counts in the cell before it, too: cells lie between voxels.
        for (const int c : {z / side, std::max(0, z - 1) / side})
          for (const int b : {y / side, std::max(0, y - 1) / side})
            for (const int a : {x / side, std::max(0, x - 1) / side}) mark(a, b, c);
      }
}

/// A ray's main axis k, the grid planes that it crosses within the grid, and its place in them.
struct PosedDensity::Path {
  int k, p, q;
  int first, last;      ///< planes
  double at_p, at_q;    ///< on plane 0
  double per_p, per_q;  ///< per plane
  double mm_per_plane;  ///< positive
  Vector3d along;       ///< voxels per mm
};

PosedDensity::PosedDensity(const Density& density, const geometry::RigidTransform& world_from_model,
                           const Vector3d& source_in_world, const Vector3d& centre_in_world)
    : density_(&density), from_centre_(source_in_world - centre_in_world) {
  const geometry::RigidTransform model_from_world = world_from_model.inverse();
  const Eigen::Affine3d voxel_from_model = density.model_from_voxel.inverse();
  voxel_from_world_ = voxel_from_model.linear() * model_from_world.rotation;
  source_ = voxel_from_model * (model_from_world * source_in_world);
}

bool PosedDensity::clip(const Vector3d& direction, Path& path) const {
  path.along = voxel_from_world_ * direction;
  path.along.cwiseAbs().maxCoeff(&path.k);
  path.p = path.k == 0 ? 1 : 0;
  path.q = 3 - path.k - path.p;
  const double per_plane = 1 / path.along[path.k];
  path.mm_per_plane = std::abs(per_plane);
  path.per_p = path.along[path.p] * per_plane;
  path.per_q = path.along[path.q] * per_plane;
  path.at_p = source_[path.p] - source_[path.k] * path.per_p;
  path.at_q = source_[path.q] - source_[path.k] * path.per_q;
  double low = 0, high = density_->size[path.k] - 1;
  const auto within = [&](double at, double per, int size) {
    const double end = size - 1;
    if (std::abs(per) < 1e-12) {
      if (at <= 0 || at >= end) high = -1;
      return;
    }
    const double a = -at / per, b = (end - at) / per;
    low = std::max(low, std::min(a, b));
    high = std::min(high, std::max(a, b));
  };
  within(path.at_p, path.per_p, density_->size[path.p]);
  within(path.at_q, path.per_q, density_->size[path.q]);
  if (!(low <= high)) return false;
  path.first = static_cast<int>(std::ceil(low));
  path.last = static_cast<int>(std::floor(high));
  return path.first <= path.last;
}

namespace {

/// Calls `take(plane, v00, v10, v01, v11, fraction along p, along q)` for every plane of the path.
template <class Path, class Take>
void for_planes(const Density& density, const Path& path, const Take& take) {
  const std::ptrdiff_t strides[3] = {1, density.size.x(),
                                     std::ptrdiff_t{density.size.x()} * density.size.y()};
  const std::ptrdiff_t step_p = strides[path.p], step_q = strides[path.q];
  const int last_p = density.size[path.p] - 2, last_q = density.size[path.q] - 2;
  for (int plane = path.first; plane <= path.last; ++plane) {
    const double p = path.at_p + path.per_p * plane;
    const double q = path.at_q + path.per_q * plane;
    const int whole_p = std::clamp(static_cast<int>(p), 0, last_p);
    const int whole_q = std::clamp(static_cast<int>(q), 0, last_q);
    const float* corner =
        density.values.data() + plane * strides[path.k] + whole_p * step_p + whole_q * step_q;
    take(plane, corner[0], corner[step_p], corner[step_q], corner[step_p + step_q],
         static_cast<float>(p - whole_p), static_cast<float>(q - whole_q));
  }
}

}  // namespace

float PosedDensity::integrate(const Vector3d& direction) const {
  Path path;
  if (!clip(direction, path)) return 0;
  float sum = 0;
  for_planes(*density_, path, [&](int, float v00, float v10, float v01, float v11, float p, float q) {
    const float low = v00 + p * (v10 - v00);
    sum += low + q * (v01 + p * (v11 - v01) - low);
  });
  return sum * static_cast<float>(path.mm_per_plane);
}

/// Eight rays with one main axis; `low` > `high` where a ray does not cross the grid.
struct PosedDensity::Bundle {
  static constexpr std::size_t rays = 8;
  std::array<Path, rays> paths;
  int k = -1, first = 1 << 30, last = -1;
  alignas(32) float p0[rays], q0[rays], per_p[rays], per_q[rays], low[rays], high[rays];
};

/// Over the planes of a path, numbered from `first`: values, slopes in the plane, slopes times the number.
struct PosedDensity::Sums {
  int first = 0;
  float value = 0, by_p = 0, by_q = 0, by_p_plane = 0, by_q_plane = 0;
};

bool PosedDensity::bundle(const std::array<Vector3d, 8>& directions, Bundle& made) const {
  for (std::size_t i = 0; i < Bundle::rays; ++i) {
    Path& path = made.paths[i];
    const bool crosses = clip(directions[i], path);
    made.low[i] = crosses ? float(path.first) : 1e9F;
    made.high[i] = crosses ? float(path.last) : -1e9F;
    if (!crosses) continue;
    if (made.k >= 0 && made.k != path.k) return false;
    made.k = path.k;
    made.first = std::min(made.first, path.first);
    made.last = std::max(made.last, path.last);
  }
  std::size_t some = 0;  // a ray that crosses stands in for those that do not
  while (some + 1 < Bundle::rays && made.low[some] > made.high[some]) ++some;
  for (std::size_t i = 0; i < Bundle::rays; ++i) {
    const Path& path = made.paths[made.low[i] <= made.high[i] ? i : some];
    made.per_p[i] = float(path.per_p);
    made.per_q[i] = float(path.per_q);
    made.p0[i] = float(path.at_p + path.per_p * made.first);
    made.q0[i] = float(path.at_q + path.per_q * made.first);
  }
  return true;
}

namespace {

/// Whether the blocks that eight rays touch between two planes of one block are empty.
template <class Bundle>
bool is_empty(const Density& density, const Bundle& bundle, int from, int to) {
  constexpr int side = Density::block;
  if (density.occupied.empty()) return false;
  float low_p = 1e9F, high_p = -1e9F, low_q = 1e9F, high_q = -1e9F;
  for (const auto along : {float(from - bundle.first), float(to - bundle.first)})
    for (std::size_t i = 0; i < Bundle::rays; ++i) {
      const float p = bundle.p0[i] + bundle.per_p[i] * along, q = bundle.q0[i] + bundle.per_q[i] * along;
      low_p = std::min(low_p, p), high_p = std::max(high_p, p);
      low_q = std::min(low_q, q), high_q = std::max(high_q, q);
    }
  const Vector3i count = density.blocks();
  const int strides[3] = {1, count.x(), count.x() * count.y()};
  const int p_axis = bundle.k == 0 ? 1 : 0, q_axis = 3 - bundle.k - p_axis;
  const auto block = [](float at, int blocks) { return std::min(std::max(int(at), 0) / side, blocks - 1); };
  const char* const slab = density.occupied.data() + from / side * strides[bundle.k];
  const int end_p = block(high_p, count[p_axis]), end_q = block(high_q, count[q_axis]);
  for (int q = block(low_q, count[q_axis]); q <= end_q; ++q)
    for (int p = block(low_p, count[p_axis]); p <= end_p; ++p)
      if (slab[p * strides[p_axis] + q * strides[q_axis]] != 0) return false;
  return true;
}

/// Calls `take(ray, plane's number, v00, v10, v01, v11, fraction along p, along q, 1 within the grid or 0)`
/// for eight rays at every plane that is not empty.
template <class Bundle, class Take>
void for_bundle(const Density& density, const Bundle& bundle, const Take& take) {
  const int strides[3] = {1, density.size.x(), density.size.x() * density.size.y()};
  const int p_axis = bundle.k == 0 ? 1 : 0, q_axis = 3 - bundle.k - p_axis;
  const int step_p = strides[p_axis], step_q = strides[q_axis];
  const int last_p = density.size[p_axis] - 2, last_q = density.size[q_axis] - 2;
  int checked = bundle.first - 1;  // planes up to here are known to hold something
  for (int plane = bundle.first; plane <= bundle.last; ++plane) {
    if (plane > checked) {
      checked = std::min(bundle.last, plane | (Density::block - 1));
      if (is_empty(density, bundle, plane, checked)) {
        plane = checked;
        continue;
      }
    }
    const float* slab = density.values.data() + std::ptrdiff_t{plane} * strides[bundle.k];
    const auto along = float(plane - bundle.first), at = float(plane);
#ifndef __clang__
#pragma GCC ivdep
#endif
    for (std::size_t i = 0; i < Bundle::rays; ++i) {
      const float p = bundle.p0[i] + bundle.per_p[i] * along, q = bundle.q0[i] + bundle.per_q[i] * along;
      const int whole_p = std::min(std::max(int(p), 0), last_p),
                whole_q = std::min(std::max(int(q), 0), last_q);
      const int index = whole_p * step_p + whole_q * step_q;
      const float inside = at >= bundle.low[i] && at <= bundle.high[i] ? 1.0F : 0.0F;
      take(i, along, slab[index], slab[index + step_p], slab[index + step_q], slab[index + step_p + step_q],
           p - float(whole_p), q - float(whole_q), inside);
    }
  }
}

}  // namespace

void PosedDensity::integrate_eight(const std::array<Vector3d, 8>& directions,
                                   std::array<float, 8>& values) const {
  Bundle rays;
  if (!bundle(directions, rays)) {
    for (std::size_t i = 0; i < Bundle::rays; ++i) values[i] = integrate(directions[i]);
    return;
  }
  values.fill(0);
  if (rays.k < 0) return;
  alignas(32) float sum[Bundle::rays] = {};
  for_bundle(
      *density_, rays,
      [&](std::size_t i, float, float v00, float v10, float v01, float v11, float p, float q, float inside) {
        const float low = v00 + p * (v10 - v00);
        sum[i] += inside * (low + q * (v01 + p * (v11 - v01) - low));
      });
  for (std::size_t i = 0; i < Bundle::rays; ++i)
    if (rays.low[i] <= rays.high[i]) values[i] = sum[i] * float(rays.paths[i].mm_per_plane);
}

RayIntegral PosedDensity::differentiate(const Vector3d& direction) const {
  Path path;
  if (!clip(direction, path)) return {};
  Sums sums{path.first};
  for_planes(*density_, path, [&](int plane, float v00, float v10, float v01, float v11, float p, float q) {
    const float low = v00 + p * (v10 - v00);
    const float slope_p = v10 - v00 + q * (v11 - v01 - v10 + v00);
    const float slope_q = v01 + p * (v11 - v01) - low;
    const auto k = static_cast<float>(plane - path.first);
    sums.value += low + q * slope_q;
    sums.by_p += slope_p;
    sums.by_q += slope_q;
    sums.by_p_plane += k * slope_p;
    sums.by_q_plane += k * slope_q;
  });
  return assembled(direction, path, sums);
}

void PosedDensity::differentiate_eight(const std::array<Vector3d, 8>& directions,
                                       std::array<RayIntegral, 8>& integrals) const {
  Bundle rays;
  if (!bundle(directions, rays)) {
    for (std::size_t i = 0; i < Bundle::rays; ++i) integrals[i] = differentiate(directions[i]);
    return;
  }
  integrals.fill({});
  if (rays.k < 0) return;
  alignas(32) float value[Bundle::rays] = {}, by_p[Bundle::rays] = {}, by_q[Bundle::rays] = {},
                    by_p_plane[Bundle::rays] = {}, by_q_plane[Bundle::rays] = {};
  for_bundle(*density_, rays,
             [&](std::size_t i, float k, float v00, float v10, float v01, float v11, float p, float q,
                 float inside) {
               const float low = v00 + p * (v10 - v00);
               const float slope_p = inside * (v10 - v00 + q * (v11 - v01 - v10 + v00));
               const float slope_q = inside * (v01 + p * (v11 - v01) - low);
               value[i] += inside * low + q * slope_q;
               by_p[i] += slope_p;
               by_q[i] += slope_q;
               by_p_plane[i] += k * slope_p;
               by_q_plane[i] += k * slope_q;
             });
  for (std::size_t i = 0; i < Bundle::rays; ++i)
    if (rays.low[i] <= rays.high[i])
      integrals[i] = assembled(directions[i], rays.paths[i],
                               {rays.first, value[i], by_p[i], by_q[i], by_p_plane[i], by_q_plane[i]});
}

RayIntegral PosedDensity::assembled(const Vector3d& direction, const Path& path, const Sums& sums) const {
  // A motion along the ray changes nothing: the slope along k is what makes the gradient normal to the ray.
  const auto gradient = [&](double p, double q) {
    Vector3d in_voxels;
    in_voxels[path.p] = p;
    in_voxels[path.q] = q;
    in_voxels[path.k] = -(path.per_p * p + path.per_q * q);
    return Vector3d(path.mm_per_plane * voxel_from_world_.transpose() * in_voxels);
  };
  const double per_plane = 1 / path.along[path.k];
  const Vector3d total = gradient(sums.by_p, sums.by_q);
  // Distance from the source at plane n: (n - source) per_plane.
  const Vector3d by_distance =
      per_plane * (gradient(sums.by_p_plane, sums.by_q_plane) + (sums.first - source_[path.k]) * total);
  const double value = double(sums.value) * path.mm_per_plane;
  RayIntegral integral;
  integral.value = static_cast<float>(value);
  integral.by_motion.head<3>() = -total.cast<float>();
  // Turning the grid changes the ray's length between two planes.
  const Vector3d by_length = value * per_plane * voxel_from_world_.row(path.k).transpose();
  const Eigen::Matrix3d by_linear =
      -(total * from_centre_.transpose() + by_distance * direction.transpose()) +
      by_length * direction.transpose();
  for (int i = 0; i < 3; ++i)
    integral.by_motion.segment<3>(3 + 3 * i) = by_linear.row(i).transpose().cast<float>();
  return integral;
}

}  // namespace helicarm::registration
