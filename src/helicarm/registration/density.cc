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

void PosedDensity::integrate_eight(const std::array<Vector3d, 8>& directions,
                                   std::array<float, 8>& values) const {
  constexpr std::size_t lanes = 8;
  std::array<Path, lanes> paths;
  alignas(32) float p0[lanes], q0[lanes], per_p[lanes], per_q[lanes], low[lanes], high[lanes],
      sum[lanes] = {};
  int k = -1, first = 1 << 30, last = -1;
  bool together = true;
  for (std::size_t i = 0; i < lanes; ++i) {
    const bool crosses = clip(directions[i], paths[i]);
    low[i] = crosses ? float(paths[i].first) : 1e9F;
    high[i] = crosses ? float(paths[i].last) : -1e9F;
    if (!crosses) continue;
    together = together && (k < 0 || k == paths[i].k);
    k = paths[i].k;
    first = std::min(first, paths[i].first);
    last = std::max(last, paths[i].last);
  }
  if (!together) {
    for (std::size_t i = 0; i < lanes; ++i) values[i] = integrate(directions[i]);
    return;
  }
  values.fill(0);
  if (k < 0) return;
  for (std::size_t i = 0; i < lanes; ++i) {
    const bool crosses = low[i] <= high[i];
    per_p[i] = crosses ? float(paths[i].per_p) : 0;
    per_q[i] = crosses ? float(paths[i].per_q) : 0;
    p0[i] = crosses ? float(paths[i].at_p + paths[i].per_p * first) : 0;
    q0[i] = crosses ? float(paths[i].at_q + paths[i].per_q * first) : 0;
  }
  const int strides[3] = {1, density_->size.x(), density_->size.x() * density_->size.y()};
  const int p_axis = k == 0 ? 1 : 0, q_axis = 3 - k - p_axis;
  const int step_p = strides[p_axis], step_q = strides[q_axis];
  const int last_p = density_->size[p_axis] - 2, last_q = density_->size[q_axis] - 2;
  for (int plane = first; plane <= last; ++plane) {
    const float* slab = density_->values.data() + std::ptrdiff_t{plane} * strides[k];
    const auto along = float(plane - first), at = float(plane);
#pragma GCC ivdep
    for (std::size_t i = 0; i < lanes; ++i) {
      const float p = p0[i] + per_p[i] * along, q = q0[i] + per_q[i] * along;
      const int whole_p = std::min(std::max(int(p), 0), last_p),
                whole_q = std::min(std::max(int(q), 0), last_q);
      const int index = whole_p * step_p + whole_q * step_q;
      const float u = p - float(whole_p), v = q - float(whole_q);
      const float v00 = slab[index], v10 = slab[index + step_p];
      const float v01 = slab[index + step_q], v11 = slab[index + step_p + step_q];
      const float near = v00 + u * (v10 - v00);
      const float value = near + v * (v01 + u * (v11 - v01) - near);
      sum[i] += at >= low[i] && at <= high[i] ? value : 0.0F;
    }
  }
  for (std::size_t i = 0; i < lanes; ++i)
    if (low[i] <= high[i]) values[i] = sum[i] * float(paths[i].mm_per_plane);
}

RayIntegral PosedDensity::differentiate(const Vector3d& direction) const {
  RayIntegral integral;
  Path path;
  if (!clip(direction, path)) return integral;
  float sum = 0, by_p = 0, by_q = 0, by_p_plane = 0, by_q_plane = 0;
  for_planes(*density_, path, [&](int plane, float v00, float v10, float v01, float v11, float p, float q) {
    const float low = v00 + p * (v10 - v00);
    const float high = v01 + p * (v11 - v01);
    const float slope_p = v10 - v00 + q * (v11 - v01 - v10 + v00);
    const float slope_q = high - low;
    const auto k = static_cast<float>(plane - path.first);
    sum += low + q * slope_q;
    by_p += slope_p;
    by_q += slope_q;
    by_p_plane += k * slope_p;
    by_q_plane += k * slope_q;
  });
  // A motion along the ray changes nothing: the slope along k is what makes the gradient normal to the ray.
  const auto gradient = [&](double p, double q) {
    Vector3d in_voxels;
    in_voxels[path.p] = p;
    in_voxels[path.q] = q;
    in_voxels[path.k] = -(path.per_p * p + path.per_q * q);
    return Vector3d(path.mm_per_plane * voxel_from_world_.transpose() * in_voxels);
  };
  const double per_plane = 1 / path.along[path.k];
  const Vector3d total = gradient(by_p, by_q);
  // Distance from the source at plane n: (n - source) per_plane.
  const Vector3d by_distance =
      per_plane * (gradient(by_p_plane, by_q_plane) + (path.first - source_[path.k]) * total);
  const double value = double(sum) * path.mm_per_plane;
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
