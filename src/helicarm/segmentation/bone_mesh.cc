// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/bone_mesh.h"

#include <algorithm>
#include <cmath>

#include <Eigen/LU>

#include "helicarm/volume/bone_edge.h"

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr double cells_across = 400;

/// How far outside the bone, in 3 widths of a voxel along the normal, linear between the voxels; no bone
/// beyond the grid.
double outside_at(const volume::ByteGrid& inside, const Vector3d& voxel) {
  const Vector3d low = voxel.array().floor();
  const Vector3d part = voxel - low;
  double value = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3i to(corner & 1, corner >> 1 & 1, corner >> 2);
    const Vector3i at = low.cast<int>() + to;
    if (!inside.has(at)) continue;
    const Vector3d weight = to.cast<double>().cwiseProduct(part) +
                            (Vector3i::Ones() - to).cast<double>().cwiseProduct(Vector3d::Ones() - part);
    value += weight.prod() * inside.values[inside.index(at)];
  }
  return 0.5 - value / 255;
}

}  // namespace

phantom::TriangleMesh surface_of(const volume::Volume& ct, const Segmentation& made, const Bone& bone) {
  if (bone.voxels == 0) return {};
  const Vector3d spacing = made.patient_from_voxel.linear().colwise().norm();
  const Vector3i margin = volume::bone_edge_margin(made.patient_from_voxel.linear());
  const Vector3i low = (bone.low - margin).cwiseMax(0);
  const Vector3i high = (bone.high + margin).cwiseMin(made.size - Vector3i::Ones());
  volume::ByteGrid own = volume::byte_grid(high - low + Vector3i::Ones());
  volume::BoneEdge edge;
  {
    std::vector<float> hu(own.values.size());
    std::size_t i = 0;
    own.each([&](const Vector3i& at) {
      const Vector3i voxel = at + low;
      const std::size_t from =
          std::size_t(voxel.x()) +
          std::size_t(made.size.x()) *
              (std::size_t(voxel.y()) + std::size_t(made.size.y()) * std::size_t(voxel.z()));
      own.values[i] = made.labels[from] == bone.label;
      hu[i++] = ct.voxels[from];
    });
    edge = volume::bone_edge(own, hu, made.patient_from_voxel.linear());
  }
  const Eigen::Affine3d voxel_from_patient =
      (made.patient_from_voxel * Eigen::Translation3d(low.cast<double>())).inverse();
  const double step = std::max(std::cbrt(spacing.prod()), bone.box.diagonal().norm() / cells_across);
  const Vector3d around = Vector3d::Constant(2 * step + 2 * spacing.maxCoeff());
  return phantom::surface_of(
      [&](const Vector3d& point) { return step * outside_at(edge.inside, voxel_from_patient * point); },
      {bone.box.min() - around, bone.box.max() + around}, step);
}

double area_cm2(const phantom::TriangleMesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles)
    sum += (mesh.corners[b] - mesh.corners[a]).cross(mesh.corners[c] - mesh.corners[a]).norm() / 2;
  return sum / 100;
}

std::string stl_in_lps(const phantom::TriangleMesh& mesh) {
  constexpr std::string_view declared = "SPACE=LPS UNITS=mm helicarm";
  std::string stl = to_stl(mesh);
  return stl.replace(0, declared.size(), declared);
}

}  // namespace helicarm::segmentation
