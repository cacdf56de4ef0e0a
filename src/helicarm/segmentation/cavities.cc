// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/cavities.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3i;
using volume::ByteGrid;

constexpr std::uint8_t reached = 3;

/// Marks what is reached along the axes from the voxels of `front`, and adds it to `all` if there is one.
template <class Passable>
void flood(ByteGrid& bone, std::vector<std::uint32_t> front, std::span<const int> axes,
           const Passable& passable, std::vector<std::uint32_t>* all, const pipeline::Progress& progress) {
  const auto strides = bone.strides();
  std::vector<std::uint32_t> next;
  while (!front.empty()) {
    if (progress.view) progress.view();
    for (const std::uint32_t i : front) {
      const Vector3i at = voxel_of(i, bone.size);
      for (const int axis : axes)
        for (const int way : {-1, 1}) {
          if (at[axis] + way < 0 || at[axis] + way >= bone.size[axis]) continue;
          const auto k = static_cast<std::uint32_t>(std::ptrdiff_t{i} + way * strides[std::size_t(axis)]);
          if (!passable(k)) continue;
          bone.values[k] = reached;
          next.push_back(k);
        }
    }
    if (all) all->insert(all->end(), next.begin(), next.end());
    front.swap(next);
    next.clear();
  }
}

/// Marks what is reached from `outside`; if that is nothing, from the edges of the grid's faces within the
/// faces, and from there everywhere.
template <class Passable>
void flood_from_outside(ByteGrid& bone, const std::vector<std::uint32_t>& outside, const Passable& passable,
                        const pipeline::Progress& progress) {
  std::vector<std::uint32_t> front;
  for (const std::uint32_t i : outside)
    if (passable(i)) bone.values[i] = reached, front.push_back(i);
  if (!front.empty()) return flood(bone, std::move(front), std::array{0, 1, 2}, passable, nullptr, progress);
  std::vector<std::uint32_t> on_faces;
  for (int axis = 0; axis < 3; ++axis) {
    const int p = (axis + 1) % 3, q = (axis + 2) % 3;
    for (const int face : {0, bone.size[axis] - 1}) {
      std::vector<std::uint32_t> edges;
      for (int i = 0; i < bone.size[p]; ++i)
        for (int j = 0; j < bone.size[q]; ++j) {
          if (i > 0 && i + 1 < bone.size[p] && j > 0 && j + 1 < bone.size[q]) continue;
          Vector3i at;
          at[axis] = face, at[p] = i, at[q] = j;
          const auto k = static_cast<std::uint32_t>(bone.index(at));
          if (!passable(k)) continue;
          bone.values[k] = reached;
          edges.push_back(k);
        }
      on_faces.insert(on_faces.end(), edges.begin(), edges.end());
      flood(bone, std::move(edges), std::array{p, q}, passable, &on_faces, progress);
    }
  }
  flood(bone, std::move(on_faces), std::array{0, 1, 2}, passable, nullptr, progress);
}

/// Cavities that are wider than their wall's gaps.
void fill_behind_gaps(ByteGrid& bone, const ChamferSteps& steps, double gap_mm,
                      const std::vector<std::uint32_t>& outside, const pipeline::Progress& progress) {
  const auto gap = static_cast<std::uint16_t>(std::min(double(farthest) - 1, gap_mm / steps.unit_mm));
  auto distances = distances_to(bone, steps, progress, [](std::uint8_t value) { return value == dense; });
  flood_from_outside(
      bone, outside, [&](std::uint32_t i) { return bone.values[i] == empty && distances[i] > gap; },
      progress);
  for (std::size_t i = 0; i < distances.size(); ++i)
    bone.values[i] = bone.values[i] == reached                       ? empty
                     : bone.values[i] == empty && distances[i] > gap ? cavity
                                                                     : bone.values[i];
  // Back to the wall, but not through it: what lies behind it is farther away by its thickness.
  distances = distances_to(bone, steps, progress, [](std::uint8_t value) { return value == cavity; });
  const auto back = static_cast<std::uint16_t>(gap + units_per_voxel / 2);
  for (std::size_t i = 0; i < distances.size(); ++i)
    if (bone.values[i] == empty && distances[i] <= back) bone.values[i] = cavity;
}

}  // namespace

void fill_cavities(ByteGrid& bone, const ChamferSteps& steps, double gap_mm,
                   const std::vector<std::uint32_t>& outside, const pipeline::Progress& progress) {
  if (gap_mm > 0) fill_behind_gaps(bone, steps, gap_mm, outside, progress);
  flood_from_outside(
      bone, outside, [&](std::uint32_t i) { return bone.values[i] == empty; }, progress);
  for (std::uint8_t& value : bone.values) value = value == reached ? empty : value == empty ? cavity : value;
}

}  // namespace helicarm::segmentation
