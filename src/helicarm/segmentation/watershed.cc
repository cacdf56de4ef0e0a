// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/watershed.h"

#include <algorithm>
#include <array>
#include <tuple>
#include <unordered_map>

#include "helicarm/segmentation/distances.h"

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3i;

/// Voxels with a depth, deepest first, in the order of memory within one depth.
std::vector<std::uint32_t> by_depth(const std::vector<std::uint16_t>& depths) {
  std::vector<std::uint32_t> first(std::size_t{farthest} + 2, 0);
  for (const std::uint16_t depth : depths)
    if (depth > 0) ++first[farthest - depth + 1];
  for (std::size_t i = 1; i < first.size(); ++i) first[i] += first[i - 1];
  std::vector<std::uint32_t> order(first.back());
  for (std::size_t i = 0; i < depths.size(); ++i)
    if (depths[i] > 0) order[first[farthest - depths[i]]++] = static_cast<std::uint32_t>(i);
  return order;
}

/// The 26 neighbours of a voxel that are in the grid.
class Neighbours {
 public:
  explicit Neighbours(const Vector3i& size) : size_(size) {
    for (int dz = -1; dz <= 1; ++dz)
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx)
          if (dx != 0 || dy != 0 || dz != 0)
            steps_.push_back(
                {{dx, dy, dz}, dx + std::ptrdiff_t{size.x()} * (dy + std::ptrdiff_t{size.y()} * dz)});
  }

  template <class Take>
  void each(std::uint32_t i, const Take& take) const {
    const Vector3i at = voxel_of(i, size_);
    const bool inside = (at.array() > 0).all() && (at.array() + 1 < size_.array()).all();
    for (const auto& [to, stride] : steps_) {
      if (!inside) {
        const Vector3i beside = at + to;
        if ((beside.array() < 0).any() || (beside.array() >= size_.array()).any()) continue;
      }
      take(std::size_t(std::ptrdiff_t{i} + stride));
    }
  }

 private:
  struct Step {
    Vector3i to;
    std::ptrdiff_t stride;
  };
  Vector3i size_;
  std::vector<Step> steps_;
};

}  // namespace

std::uint32_t Watershed::root(std::uint32_t region) {
  while (joined[region] != region) region = joined[region] = joined[joined[region]];
  return region;
}

/// The deeper one stays.
std::uint32_t Watershed::join(std::uint32_t a, std::uint32_t b) {
  a = root(a), b = root(b);
  if (depths[a] < depths[b]) std::swap(a, b);
  return joined[b] = a;
}

double Watershed::width(const Neck& neck) {
  return double(neck.depth) / double(std::min(depths[root(neck.a)], depths[root(neck.b)]));
}

double Watershed::local_width(const Neck& neck, const DepthMap& depth, double reach_in_radii) {
  constexpr double samples = 8;  // of a neck's radius
  const double reach = reach_in_radii * neck.depth;
  const Eigen::Vector3d spacing = depth.spacing;
  const Vector3i stride = (neck.depth / samples / spacing.array()).cast<int>().max(1);
  const Vector3i steps = (reach / spacing.array()).cast<int>() / stride.array();
  const Vector3i middle = voxel_of(neck.at, depth.size);
  const std::uint32_t a = root(neck.a), b = root(neck.b);
  std::uint16_t of_a = neck.depth, of_b = neck.depth;
  for (int z = -steps.z(); z <= steps.z(); ++z)
    for (int y = -steps.y(); y <= steps.y(); ++y)
      for (int x = -steps.x(); x <= steps.x(); ++x) {
        const Vector3i step = Vector3i(x, y, z).cwiseProduct(stride), at = middle + step;
        if ((at.array() < 0).any() || (at.array() >= depth.size.array()).any()) continue;
        if (step.cast<double>().cwiseProduct(spacing).norm() > reach) continue;
        const auto i = std::size_t(at.x()) +
                       std::size_t(depth.size.x()) *
                           (std::size_t(at.y()) + std::size_t(depth.size.y()) * std::size_t(at.z()));
        if (labels[i] == 0) continue;
        const std::uint32_t region = region_at(i);
        if (region == a) of_a = std::max(of_a, depth.values[i]);
        if (region == b) of_b = std::max(of_b, depth.values[i]);
      }
  return double(neck.depth) / double(std::min(of_a, of_b));
}

Watershed watershed_of(const std::vector<std::uint16_t>& depths, const Vector3i& size, std::uint16_t small,
                       const pipeline::Progress& progress) {
  Watershed made;
  made.labels.assign(depths.size(), 0);
  std::unordered_map<std::uint64_t, Neck> necks;
  const Neighbours neighbours(size);
  constexpr std::size_t between_calls = 1 << 20;
  std::size_t done = 0;
  std::vector<std::uint32_t> beside;
  for (const std::uint32_t voxel : by_depth(depths)) {
    if (done++ % between_calls == 0 && progress.view) progress.view();
    std::uint32_t own = 0;
    std::uint16_t steepest = 0;
    beside.clear();
    neighbours.each(voxel, [&](std::size_t k) {
      if (made.labels[k] == 0) return;
      const std::uint32_t region = made.region_at(k);
      if (std::ranges::find(beside, region) == beside.end()) beside.push_back(region);
      if (depths[k] > steepest) steepest = depths[k], own = region;
    });
    if (beside.empty()) {
      own = static_cast<std::uint32_t>(made.joined.size());
      made.joined.push_back(own);
      made.depths.push_back(depths[voxel]);
    }
    made.labels[voxel] = own + 1;
    for (std::size_t i = 0; i < beside.size(); ++i)
      for (std::size_t k = 0; k < i; ++k) {
        const std::uint32_t a = made.root(beside[i]), b = made.root(beside[k]);
        if (a == b) continue;
        const Neck neck{std::min(a, b), std::max(a, b), depths[voxel], voxel};
        if (made.width(neck) >= surely_one || std::min(made.depths[a], made.depths[b]) <= small)
          made.join(a, b);
        else
          necks.try_emplace(std::uint64_t{neck.a} << 32 | neck.b, neck);
      }
  }
  for (const auto& [key, neck] : necks) made.necks.push_back(neck);
  std::ranges::sort(made.necks, [](const Neck& x, const Neck& y) {
    return std::tuple(y.depth, x.at, x.a, x.b) < std::tuple(x.depth, y.at, y.a, y.b);
  });
  return made;
}

}  // namespace helicarm::segmentation
