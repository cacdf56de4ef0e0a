// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/cavities.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3i;
using volume::ByteGrid;

constexpr std::uint8_t reached = 3, asked = 4;
// Area of a cavity's openings in terms of its volume: of a cube that lacks one wall it is 1, of the space in
// a joint 0.3 to 1.5.
constexpr double widest_mouth = 0.2;

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

/// What is reached within the grid's faces from their edges: a ring of bone on a face keeps its marrow.
template <class Passable>
std::vector<std::uint32_t> reached_on_faces(ByteGrid& bone, const Passable& passable,
                                            const pipeline::Progress& progress) {
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
  return on_faces;
}

/// Marks what is reached from those voxels of `outside` that no ring of bone on a face encloses; if there are
/// none, from all that none encloses.
template <class Passable>
void flood_from_outside(ByteGrid& bone, const std::vector<std::uint32_t>& outside, const Passable& passable,
                        const pipeline::Progress& progress) {
  const std::vector<std::uint32_t> on_faces = reached_on_faces(bone, passable, progress);
  std::vector<std::uint32_t> front;
  for (const std::uint32_t i : outside)
    if (bone.values[i] == reached) front.push_back(i);
  if (front.empty())
    front = on_faces;
  else {
    for (const std::uint32_t i : on_faces) bone.values[i] = empty;
    for (const std::uint32_t i : front) bone.values[i] = reached;
  }
  flood(bone, std::move(front), std::array{0, 1, 2}, passable, nullptr, progress);
}

/// Area of a voxel's faces across its axes.
Eigen::Vector3d face_areas(const Eigen::Matrix3d& mm_from_voxel) {
  Eigen::Vector3d areas;
  for (int axis = 0; axis < 3; ++axis)
    areas[axis] = mm_from_voxel.col((axis + 1) % 3).cross(mm_from_voxel.col((axis + 2) % 3)).norm();
  return areas;
}

/// Marks the voxels that hang together with an empty one as `asked`, and returns them and the area in mm2
/// over which they open to what is reached.
double collect(ByteGrid& bone, std::uint32_t first, const Eigen::Vector3d& areas,
               std::vector<std::uint32_t>& voxels) {
  const auto strides = bone.strides();
  double mouth = 0;
  voxels.assign(1, first);
  bone.values[first] = asked;
  for (std::size_t n = 0; n < voxels.size(); ++n) {
    const Vector3i at = voxel_of(voxels[n], bone.size);
    for (int axis = 0; axis < 3; ++axis)
      for (const int way : {-1, 1}) {
        if (at[axis] + way < 0 || at[axis] + way >= bone.size[axis]) continue;
        const auto k =
            static_cast<std::uint32_t>(std::ptrdiff_t{voxels[n]} + way * strides[std::size_t(axis)]);
        if (bone.values[k] == reached) mouth += areas[axis];
        if (bone.values[k] != empty) continue;
        bone.values[k] = asked;
        voxels.push_back(k);
      }
  }
  return mouth;
}

/// Turns what is empty and within `reach` of `from` into it.
void widen(ByteGrid& bone, const ChamferSteps& steps, std::uint8_t from, std::uint16_t reach,
           const pipeline::Progress& progress) {
  const auto distances =
      distances_to(bone, steps, progress, [&](std::uint8_t value) { return value == from; });
  for (std::size_t i = 0; i < distances.size(); ++i)
    if (bone.values[i] == empty && distances[i] <= reach) bone.values[i] = from;
}

/// Marks the outside that a sphere of this radius reaches, and the cavities that it would fit in.
void pass_sphere(ByteGrid& bone, const ChamferSteps& steps, std::uint16_t radius,
                 const std::vector<std::uint32_t>& outside, const pipeline::Progress& progress) {
  const auto distances =
      distances_to(bone, steps, progress, [](std::uint8_t value) { return value != empty; });
  const auto fits = [&](std::size_t i) { return bone.values[i] == empty && distances[i] > radius; };
  flood_from_outside(bone, outside, fits, progress);
  for (std::size_t i = 0; i < distances.size(); ++i)
    if (fits(i)) bone.values[i] = cavity;
  // Back to the wall, but not through it: what lies behind it is farther away by its thickness.
  const auto back = static_cast<std::uint16_t>(radius + units_per_voxel / 2);
  widen(bone, steps, cavity, back, progress);
  widen(bone, steps, reached, back, progress);
}

/// Cavities whose openings a sphere of this radius does not pass.
void fill_to(ByteGrid& bone, const ChamferSteps& steps, std::uint16_t radius,
             const Eigen::Matrix3d& mm_from_voxel, const std::vector<std::uint32_t>& outside,
             const pipeline::Progress& progress) {
  if (radius == 0)
    flood_from_outside(
        bone, outside, [&](std::uint32_t i) { return bone.values[i] == empty; }, progress);
  else
    pass_sphere(bone, steps, radius, outside, progress);
  const Eigen::Vector3d areas = face_areas(mm_from_voxel);
  const double voxel_mm3 = std::abs(mm_from_voxel.determinant());
  std::vector<std::uint32_t> voxels;
  for (std::size_t i = 0; i < bone.values.size(); ++i) {
    if (bone.values[i] != empty) continue;
    const double mouth = collect(bone, static_cast<std::uint32_t>(i), areas, voxels);
    const double side = std::cbrt(double(voxels.size()) * voxel_mm3);
    if (mouth > widest_mouth * side * side) continue;
    for (const std::uint32_t k : voxels) bone.values[k] = cavity;
  }
  for (std::uint8_t& value : bone.values)
    if (value == reached || value == asked) value = empty;
}

}  // namespace

void fill_cavities(ByteGrid& bone, const Eigen::Matrix3d& mm_from_voxel, double gap_mm,
                   const std::vector<std::uint32_t>& outside, const pipeline::Progress& progress) {
  const ChamferSteps steps(mm_from_voxel);
  const auto units = [&](double mm) {
    return static_cast<std::uint16_t>(std::min(double(farthest) - 1, mm / steps.unit_mm));
  };
  const double voxel_mm = mm_from_voxel.colwise().norm().minCoeff();
  for (double mm = gap_mm; mm >= voxel_mm; mm /= 2)
    fill_to(bone, steps, units(mm), mm_from_voxel, outside, progress);
  fill_to(bone, steps, 0, mm_from_voxel, outside, progress);
}

}  // namespace helicarm::segmentation
