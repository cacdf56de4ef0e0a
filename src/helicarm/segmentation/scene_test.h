// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/segmentation/segment.h"

namespace helicarm::segmentation {

/// An ellipsoid along the axes.
struct TestBone {
  Eigen::Vector3d centre, radii;

  /// 0 at the surface, negative inside; about mm.
  double operator()(const Eigen::Vector3d& p) const {
    return ((p - centre).cwiseQuotient(radii).norm() - 1) * radii.minCoeff();
  }
  double volume_cm3() const { return 4.0 / 3 * EIGEN_PI * radii.prod() / 1000; }
};

/// Two bones whose cortices touch at z about 3.5 mm.
inline const TestBone upper{{0, 0, 25}, {16, 17, 22}}, lower{{1, 0, -21}, {18, 15, 25}};

struct TestCt {
  volume::Volume volume;
  std::vector<int> truth;  ///< number of the nearest bone that holds the voxel, from 1 on
};

/// Shells of 2 mm and 1200 HU around marrow in soft tissue; voxels of a size between those of their corners.
inline TestCt ct_of(const std::vector<TestBone>& bones, const Eigen::Vector3d& spacing,
                    const Eigen::Matrix3d& turn = Eigen::Matrix3d::Identity(),
                    const Eigen::Vector3d& half = {26, 26, 56},
                    const std::function<bool(const Eigen::Vector3d&)>& hole = {}) {
  TestCt made;
  made.volume.size = (2 * half.array() / spacing.array()).floor().cast<int>() + 1;
  made.volume.patient_from_voxel = Eigen::Affine3d(turn) * Eigen::Scaling(spacing);
  made.volume.patient_from_voxel.translation() -=
      made.volume.patient_from_voxel * (0.5 * (made.volume.size.cast<double>().array() - 1)).matrix();
  const auto hu_at = [&](const Eigen::Vector3d& p) {
    double hu = 40;
    for (const TestBone& bone : bones)
      if (const double depth = -bone(p); depth > 0) {
        const bool shell = depth < 2 && !(hole && hole(p));
        hu = std::max(hu, shell ? 1200.0 : 60.0);
      }
    return hu;
  };
  for (int z = 0; z < made.volume.size.z(); ++z)
    for (int y = 0; y < made.volume.size.y(); ++y)
      for (int x = 0; x < made.volume.size.x(); ++x) {
        const Eigen::Vector3d voxel(x, y, z);
        double hu = 0;
        for (int corner = 0; corner < 8; ++corner)
          hu += hu_at(made.volume.patient_from_voxel *
                      (voxel + 0.25 * Eigen::Vector3d((corner & 1) * 2 - 1, (corner & 2) - 1,
                                                      (corner & 4) / 2 - 1))) /
                8;
        made.volume.voxels.push_back(static_cast<float>(hu));
        const Eigen::Vector3d p = made.volume.patient_from_voxel * voxel;
        int owner = 0;
        double least = 0;
        for (std::size_t i = 0; i < bones.size(); ++i)
          if (bones[i](p) < least) least = bones[i](p), owner = int(i) + 1;
        made.truth.push_back(owner);
      }
  return made;
}

/// Twice the common voxels over the sum of both.
inline double dice(const TestCt& ct, int bone, const Segmentation& made, int label) {
  double common = 0, both = 0;
  for (std::size_t i = 0; i < ct.truth.size(); ++i) {
    const bool a = ct.truth[i] == bone, b = made.labels[i] == label;
    common += a && b, both += a + b;
  }
  return 2 * common / both;
}

inline const Seed on_upper{"upper", {0, 0, 46}}, on_lower{"lower", {1, 0, -45}};

inline const TestCt& plain_ct() {
  static const TestCt ct = ct_of({upper, lower}, {1, 1, 1});
  return ct;
}

inline Failure refusal_of(const TestCt& ct, const std::vector<Seed>& seeds,
                          const SegmentOptions& options = {}) {
  const auto made = segment(ct.volume, seeds, options);
  EXPECT_FALSE(made);
  return made ? Failure{Reason::usage, "not refused"} : made.error();
}

}  // namespace helicarm::segmentation
