// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/volume.h"

#include <cmath>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/xray/digest.h"

namespace helicarm::volume {
namespace {

// Micro-CT voxels are some micrometres; 100 mm between voxels cannot be a scan of a knee.
constexpr double least_spacing_mm = 1e-3;
constexpr double most_spacing_mm = 100;
// Of a unit cell: 0.5 is a shear of 60 degrees, beyond any gantry tilt.
constexpr double least_cell = 0.5;

}  // namespace

Expected<std::size_t> voxel_count(const Eigen::Vector3d& size, const std::string& origin) {
  double count = 1;
  for (const double side : size) {
    if (!(side >= 1 && side <= max_volume_side && side == std::floor(side)))
      return fail(Reason::bad_size,
                  fmt::format("{}: a side of {} voxels, must be 1 to {}", origin, side, max_volume_side));
    count *= side;
  }
  if (count * sizeof(float) > static_cast<double>(max_volume_bytes))
    return fail(Reason::bad_size, fmt::format("{}: {} x {} x {} voxels, limit {} in all", origin, size.x(),
                                              size.y(), size.z(), max_volume_bytes / sizeof(float)));
  return static_cast<std::size_t>(count);
}

bool has_spacing(const Volume& volume, const Eigen::Vector3d& voxel_mm) {
  const Eigen::Vector3d spacing = volume.patient_from_voxel.linear().colwise().norm();
  return spacing.isApprox(voxel_mm, 1e-3);
}

bool is_same_grid(const Volume& volume, const Volume& other) {
  constexpr double same_place_voxels = 0.1;
  if (volume.size != other.size) return false;
  const Eigen::Affine3d there = other.patient_from_voxel.inverse() * volume.patient_from_voxel;
  const Eigen::Vector3d last = (volume.size.cast<double>().array() - 1).matrix();
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d at = last.cwiseProduct(Eigen::Vector3d(corner & 1, corner >> 1 & 1, corner >> 2));
    if (!((there * at - at).cwiseAbs().maxCoeff() < same_place_voxels)) return false;
  }
  return true;
}

Expected<void> check_grid(const Eigen::Affine3d& patient_from_voxel, const std::string& origin) {
  if (!patient_from_voxel.matrix().allFinite())
    return fail(Reason::not_finite, fmt::format("{}: the voxels' positions are not finite", origin));
  const Eigen::Vector3d spacing = patient_from_voxel.linear().colwise().norm();
  for (const double step : spacing)
    if (!(step >= least_spacing_mm && step <= most_spacing_mm))
      return fail(Reason::bad_value, fmt::format("{}: a spacing of {} mm, must be {} to {}", origin, step,
                                                 least_spacing_mm, most_spacing_mm));
  const double cell = std::abs(patient_from_voxel.linear().determinant()) / spacing.prod();
  if (!(cell >= least_cell))
    return fail(Reason::bad_value, fmt::format("{}: the axes' directions are nearly coplanar (triple product "
                                               "of their unit vectors {:.3g}, minimum {})",
                                               origin, cell, least_cell));
  return {};
}

std::string volume_key(const Volume& volume) {
  const Eigen::Matrix4d matrix = volume.patient_from_voxel.matrix();
  const auto bytes = [](const auto* data, std::size_t size) {
    return xray::digest({reinterpret_cast<const char*>(data), size});
  };
  return xray::digest(bytes(volume.size.data(), sizeof(int) * 3) + bytes(matrix.data(), sizeof matrix) +
                      bytes(volume.voxels.data(), volume.voxels.size() * sizeof(float)));
}

}  // namespace helicarm::volume
