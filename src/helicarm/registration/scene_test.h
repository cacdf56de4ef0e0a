// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <vector>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/registration/model.h"
#include "helicarm/registration/raster.h"
#include "helicarm/volume/drr.h"

namespace helicarm::registration {

/// A lopsided bone of three ellipsoids, 1 mm voxels, Hounsfield units; `size`: relative.
inline volume::Volume lopsided_bone(double size = 1, double bump = 9) {
  volume::Volume volume;
  volume.size = {56, 48, 64};
  volume.patient_from_voxel = Eigen::Translation3d(-30, 12, 5) * Eigen::Scaling(size);
  const auto inside = [](double x, double y, double z, const Eigen::Vector3d& c, const Eigen::Vector3d& r) {
    return (Eigen::Vector3d(x, y, z) - c).cwiseQuotient(r).squaredNorm() < 1;
  };
  for (int z = 0; z < 64; ++z)
    for (int y = 0; y < 48; ++y)
      for (int x = 0; x < 56; ++x) {
        const bool shaft = inside(x, y, z, {26, 22, 30}, {8, 10, 28});
        const bool marrow = inside(x, y, z, {26, 22, 30}, {4, 6, 24});
        const bool knob = inside(x, y, z, {36, 26, 14}, {13, bump, 9});
        const bool spur = inside(x, y, z, {18, 34, 48}, {11, 7, 6});
        volume.voxels.push_back(marrow ? 100.0F : shaft || knob || spur ? 1200.0F : -1024.0F);
      }
  return volume;
}

/// `size`: of the image, pixels.
inline geometry::View view_from(double degrees, int size = 160) {
  geometry::View view;
  view.intrinsics = {1300, 1300, 0.5 * (size - 1), 0.5 * (size - 1), 0};
  const double angle = degrees * EIGEN_PI / 180;
  const Eigen::Vector3d ray(std::sin(angle), std::cos(angle), 0);
  const Eigen::Vector3d right = ray.cross(Eigen::Vector3d::UnitZ()).normalized();
  view.camera_from_world.rotation << right.transpose(), ray.cross(right).transpose(), ray.transpose();
  view.camera_from_world.translation = {0, 0, 650};
  return view;
}

/// The model's volume at a pose in the world, in front of the sources.
inline geometry::RigidTransform true_pose() {
  const Eigen::Matrix3d rotation = geometry::rotation_from_vector({0.4, -0.2, 0.9});
  return {rotation, -(rotation * Eigen::Vector3d(-4, 34, 35))};
}

/// An X-ray image by exact line integrals of the constant voxels, with soft tissue of another attenuation
/// that varies slowly, and noise.
inline RegistrationView image_of(const volume::Volume& volume,
                                 const geometry::RigidTransform& world_from_patient,
                                 const geometry::View& view, const char* name, std::uint32_t stream,
                                 double noise = 0.003, int size = 160) {
  const volume::Absorber absorber(volume, {0.02, 0.000017, 0, 1, -800}, 1);
  const geometry::View from_patient{view.intrinsics, view.camera_from_world * world_from_patient};
  const auto integrals = *volume::drr(absorber, from_patient, size, size, 1);
  RandomStream random(5, stream);
  RegistrationView made;
  made.name = name;
  made.view = view;
  made.grey = image::Image<float>(size, size);
  for (int v = 0; v < size; ++v)
    for (int u = 0; u < size; ++u) {
      const double tissue = 0.8 + 0.3 * std::cos(0.01 * u) + 0.002 * v;
      made.grey(u, v) = static_cast<float>(
          4000 * (std::exp(-tissue - double(integrals(u, v))) + noise * random.normal()) + 40);
    }
  return made;
}

inline std::vector<RegistrationView> two_views(const volume::Volume& volume,
                                               const geometry::RigidTransform& pose = true_pose()) {
  return {image_of(volume, pose, view_from(0), "AP", 1), image_of(volume, pose, view_from(80), "LAT", 2)};
}

}  // namespace helicarm::registration
