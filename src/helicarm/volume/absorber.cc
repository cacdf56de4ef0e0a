// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/absorber.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include <sys/mman.h>

#include "helicarm/core/parallel.h"
#include "helicarm/volume/march.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

float value_of(const Ramp& ramp, float voxel) {
  const double value =
      std::clamp(ramp.at_zero + ramp.slope * static_cast<double>(voxel), ramp.low, ramp.high);
  return static_cast<double>(voxel) < ramp.least ? 0.0F : static_cast<float>(value);
}

/// Bounding box of a range's non-zero voxels, and their maximum.
struct Extent {
  Vector3i low = Vector3i::Constant(std::numeric_limits<int>::max());
  Vector3i high = Vector3i::Constant(-1);
  float greatest = 0;

  void add(const Extent& other) {
    low = low.cwiseMin(other.low);
    high = high.cwiseMax(other.high);
    greatest = std::max(greatest, other.greatest);
  }
};

Extent extent_of_slice(const Volume& volume, const Ramp& ramp, int z) {
  Extent extent;
  const std::size_t width = static_cast<std::size_t>(volume.size.x());
  const float* row =
      volume.voxels.data() + static_cast<std::size_t>(z) * width * static_cast<std::size_t>(volume.size.y());
  for (int y = 0; y < volume.size.y(); ++y, row += width) {
    const auto holds = [&](float voxel) { return value_of(ramp, voxel) != 0; };
    const float* first = std::find_if(row, row + width, holds);
    if (first == row + width) continue;
    const float* last = row + width - 1;
    while (!holds(*last)) --last;
    extent.low = extent.low.cwiseMin(Vector3i(static_cast<int>(first - row), y, z));
    extent.high = extent.high.cwiseMax(Vector3i(static_cast<int>(last - row), y, z));
    for (const float* voxel = first; voxel <= last; ++voxel)
      extent.greatest = std::max(extent.greatest, std::abs(value_of(ramp, *voxel)));
  }
  return extent;
}

/// Rays cross a small page every slab or two; the system may ignore this advice.
void ask_for_large_pages(void* start, std::size_t size) {
  constexpr std::size_t page = 4096;
  if (std::align(page, page, start, size) != nullptr) madvise(start, size / page * page, MADV_HUGEPAGE);
}

/// Block with a margin of zeros, and padding for reads (multiplied by 0) past the margin's last voxel.
Absorber::Block empty_block(const Vector3i& size, int along) {
  Absorber::Block block;
  const int other = 1 - along;
  block.stride[along] = 1;
  block.stride[other] = size[along] + 2;
  block.stride.z() = block.stride[other] * (size[other] + 2);
  const auto slice = static_cast<std::size_t>(block.stride.z());
  const std::size_t count =
      slice * static_cast<std::size_t>(size.z() + 3) + static_cast<std::size_t>(block.stride[other]) + 8;
  block.values.reserve(count);
  ask_for_large_pages(block.values.data(), count * sizeof(std::int16_t));
  block.values.resize(count);
  return block;
}

/// Up to eight rays along one axis, collected before they are marched.
struct Bundle {
  MarchRays rays;
  std::array<std::size_t, march_simd> number;
  std::array<float, march_simd> length;  ///< mm a slab
  int count = 0;
  int first = std::numeric_limits<int>::max();
  int last = 0;
};

/// The part of a line inside a box [0, size]; empty where leave <= enter.
void clip(const Vector3d& source, const Vector3d& direction, const Vector3d& size, double& enter,
          double& leave) {
  for (int axis = 0; axis < 3; ++axis) {
    if (direction[axis] == 0) {
      if (source[axis] < 0 || source[axis] > size[axis]) leave = -1;
      continue;
    }
    const double per = 1 / direction[axis];
    const double a = -source[axis] * per;
    const double b = (size[axis] - source[axis]) * per;
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
}

}  // namespace

Absorber::Absorber(const Volume& volume, const Ramp& ramp, unsigned threads) {
  // There, voxel centres are integers; here, lower faces are.
  voxel_from_patient_ = Eigen::Translation3d(0.5, 0.5, 0.5) * volume.patient_from_voxel.inverse();
  whole_ = volume.size.cast<double>();
  const auto slices = static_cast<std::size_t>(volume.size.z());
  std::vector<Extent> extents(slices);
  parallel_for(slices, threads,
               [&](std::size_t z) { extents[z] = extent_of_slice(volume, ramp, static_cast<int>(z)); });
  Extent extent;
  for (const Extent& slice : extents) extent.add(slice);
  if (extent.high.x() < 0) extent.low.setZero();
  first_ = extent.low;
  size_ = (extent.high - extent.low).array() + 1;
  step_ = std::max(extent.greatest, 1e-30F) / 32767;

  block_ = empty_block(size_, 0);
  parallel_for(static_cast<std::size_t>(size_.z()), threads, [&](std::size_t slice) {
    const int z = static_cast<int>(slice);
    const float per_step = 1 / step_;
    for (int y = 0; y < size_.y(); ++y) {
      const float* from =
          volume.voxels.data() + first_.x() +
          static_cast<std::ptrdiff_t>(volume.size.x()) *
              (first_.y() + y + static_cast<std::ptrdiff_t>(volume.size.y()) * (first_.z() + z));
      std::int16_t* to = block_.values.data() + 1 + static_cast<std::ptrdiff_t>(block_.stride.y()) * (y + 1) +
                         static_cast<std::ptrdiff_t>(block_.stride.z()) * (z + 1);
      for (int x = 0; x < size_.x(); ++x)
        to[x] = static_cast<std::int16_t>(std::lrint(value_of(ramp, from[x]) * per_step));
    }
  });
}

bool Absorber::contains(const Vector3d& point) const {
  const Vector3d voxel = voxel_from_patient_ * point;
  return (voxel.array() >= 0).all() && (voxel.array() <= whole_.array()).all();
}

const Absorber::Block& Absorber::block_for(int axis) const {
  if (axis != 0) return block_;
  std::call_once(turn_, [&] {
    turned_ = empty_block(size_, 1);
    constexpr int tile = 32;  // a tile in either order fits the L1 cache
    for (int z = 1; z <= size_.z(); ++z)
      for (int y0 = 1; y0 <= size_.y(); y0 += tile)
        for (int x0 = 1; x0 <= size_.x(); x0 += tile)
          for (int x = x0; x < std::min(x0 + tile, size_.x() + 1); ++x) {
            const std::int16_t* from =
                block_.values.data() + x + static_cast<std::ptrdiff_t>(block_.stride.z()) * z;
            std::int16_t* to = turned_.values.data() + static_cast<std::ptrdiff_t>(turned_.stride.x()) * x +
                               static_cast<std::ptrdiff_t>(turned_.stride.z()) * z;
            for (int y = y0; y < std::min(y0 + tile, size_.y() + 1); ++y)
              to[y] = from[std::ptrdiff_t{y} * block_.stride.y()];
          }
  });
  return turned_;
}

void Absorber::integrate(const Vector3d& source, std::span<const Vector3d> directions,
                         std::span<float> integrals) const {
  const Vector3d start = voxel_from_patient_ * source - first_.cast<double>();
  const Vector3d size = size_.cast<double>();
  std::array<Bundle, 3> bundles;
  const auto finish = [&](int axis) {
    Bundle& bundle = bundles[static_cast<std::size_t>(axis)];
    const int p = axis == 0 ? 1 : 0;
    const int q = 3 - axis - p;
    for (int lane = bundle.count; lane < march_simd; ++lane) {
      MarchRays& rays = bundle.rays;
      rays.p[lane] = rays.q[lane] = -1;
      rays.dp[lane] = rays.dq[lane] = rays.alike[lane] = 0;
      rays.per_dp[lane] = rays.per_dq[lane] = 1;
    }
    const Block& block = block_for(axis);
    std::array<float, march_simd> sums;
    march({block.values.data() + block.stride[axis], block.stride[axis], block.stride[q],
           static_cast<float>(size_[p] + 1), static_cast<float>(size_[q] + 1)},
          bundle.rays, bundle.first, bundle.last, sums.data());
    for (int lane = 0; lane < bundle.count; ++lane) {
      const auto l = static_cast<std::size_t>(lane);
      integrals[bundle.number[l]] = sums[l] * bundle.length[l] * step_;
    }
    bundle = Bundle();
  };

  for (std::size_t i = 0; i < directions.size(); ++i) {
    integrals[i] = 0;
    const Vector3d direction = voxel_from_patient_.linear() * directions[i];
    double enter = 0;
    double leave = std::numeric_limits<double>::infinity();
    clip(start, direction, size, enter, leave);
    if (!(leave > enter)) continue;
    int d = 0;
    direction.cwiseAbs().maxCoeff(&d);
    const int p = d == 0 ? 1 : 0;
    const int q = 3 - d - p;
    const double per = 1 / direction[d];
    const double dp = direction[p] * per;
    const double dq = direction[q] * per;

    Bundle& bundle = bundles[static_cast<std::size_t>(d)];
    const int lane = bundle.count++;
    bundle.rays.p[lane] = static_cast<float>(start[p] - start[d] * dp + std::min(dp, 0.0) + 1);
    bundle.rays.q[lane] = static_cast<float>(start[q] - start[d] * dq + std::min(dq, 0.0) + 1);
    bundle.rays.dp[lane] = static_cast<float>(dp);
    bundle.rays.dq[lane] = static_cast<float>(dq);
    bundle.rays.per_dp[lane] = static_cast<float>(1 / std::max(std::abs(dp), 1e-20));
    bundle.rays.per_dq[lane] = static_cast<float>(1 / std::max(std::abs(dq), 1e-20));
    bundle.rays.alike[lane] = dp * dq >= 0 ? 1 : 0;
    bundle.number[static_cast<std::size_t>(lane)] = i;
    bundle.length[static_cast<std::size_t>(lane)] = static_cast<float>(directions[i].norm() * std::abs(per));
    const double a = start[d] + enter * direction[d];
    const double b = start[d] + leave * direction[d];
    // One slab more on each side against rounding: the margin adds nothing.
    bundle.first = std::max(0, std::min(bundle.first, static_cast<int>(std::min(a, b)) - 1));
    bundle.last = std::min(size_[d], std::max(bundle.last, static_cast<int>(std::max(a, b)) + 2));
    if (bundle.count == march_simd) finish(d);
  }
  for (int axis = 0; axis < 3; ++axis)
    if (bundles[static_cast<std::size_t>(axis)].count > 0) finish(axis);
}

}  // namespace helicarm::volume
