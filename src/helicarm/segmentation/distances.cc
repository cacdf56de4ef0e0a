// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/distances.h"

#include <algorithm>
#include <cmath>

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3i;

constexpr double longest_step = 5000;  // with `farthest` below 2^16

/// One row by another, `shift` voxels along it.
void take_row(std::uint16_t* here, const std::uint16_t* there, int count, int shift, std::uint16_t length) {
  const int first = std::max(0, -shift), last = std::min(count, count - shift);
  for (int x = first; x < last; ++x)
    here[x] = std::min(here[x], static_cast<std::uint16_t>(there[x + shift] + length));
}

/// One of the two passes; `way`: 1 in the order of memory, -1 against it.
void pass(std::vector<std::uint16_t>& distances, const Vector3i& size, const ChamferSteps& steps, int way,
          const pipeline::Progress& progress) {
  const auto row = [&](int y, int z) {
    return distances.data() +
           std::size_t(size.x()) * (std::size_t(y) + std::size_t(size.y()) * std::size_t(z));
  };
  const auto in_order = [way](int k, int count) { return way > 0 ? k : count - 1 - k; };
  for (int k = 0; k < size.z(); ++k) {
    if (progress.view) progress.view();
    const int z = in_order(k, size.z());
    for (int j = 0; j < size.y(); ++j) {
      const int y = in_order(j, size.y());
      std::uint16_t* here = row(y, z);
      for (std::size_t n = 0; n + 1 < steps.earlier.size(); ++n) {
        const Vector3i to = way * steps.earlier[n].to;
        if (y + to.y() < 0 || y + to.y() >= size.y() || z + to.z() < 0 || z + to.z() >= size.z()) continue;
        take_row(here, row(y + to.y(), z + to.z()), size.x(), to.x(), steps.earlier[n].length);
      }
      const std::uint16_t along = steps.earlier.back().length;
      for (int i = 1; i < size.x(); ++i) {
        std::uint16_t& value = here[in_order(i, size.x())];
        value = std::min(value, static_cast<std::uint16_t>(here[in_order(i - 1, size.x())] + along));
      }
    }
  }
}

}  // namespace

ChamferSteps::ChamferSteps(const Eigen::Matrix3d& mm_from_voxel)
    : unit_mm(mm_from_voxel.colwise().norm().minCoeff() / units_per_voxel) {
  std::size_t n = 0;
  for (int dz = -1; dz <= 0; ++dz)
    for (int dy = -1; dy <= (dz < 0 ? 1 : 0); ++dy)
      for (int dx = -1; dx <= (dz < 0 || dy < 0 ? 1 : -1); ++dx) {
        const Vector3i to(dx, dy, dz);
        const double length = (mm_from_voxel * to.cast<double>()).norm() / unit_mm;
        earlier[n++] = {to, static_cast<std::uint16_t>(std::lround(std::min(length, longest_step)))};
      }
}

void spread(std::vector<std::uint16_t>& distances, const Vector3i& size, const ChamferSteps& steps,
            const pipeline::Progress& progress) {
  pass(distances, size, steps, 1, progress);
  pass(distances, size, steps, -1, progress);
}

}  // namespace helicarm::segmentation
