// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/absorber.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/volume/drr.h"

namespace helicarm::volume {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

std::size_t index(const Vector3i& size, int x, int y, int z) {
  return static_cast<std::size_t>(x) +
         static_cast<std::size_t>(size.x()) *
             (static_cast<std::size_t>(y) + static_cast<std::size_t>(size.y()) * static_cast<std::size_t>(z));
}

template <class Value>
Volume volume_of(const Vector3i& size, Value&& value) {
  Volume volume;
  volume.size = size;
  volume.voxels.resize(static_cast<std::size_t>(size.prod()));
  for (int z = 0; z < size.z(); ++z)
    for (int y = 0; y < size.y(); ++y)
      for (int x = 0; x < size.x(); ++x) volume.voxels[index(size, x, y, z)] = value(x, y, z);
  volume.patient_from_voxel = Eigen::Translation3d(-0.5 * (size.cast<double>().array() - 1).matrix());
  return volume;
}

Volume noise_volume() {
  RandomStream random(1, 900);
  return volume_of({11, 8, 14}, [&](int x, int y, int) {
    return x < 2 || y == 7 ? 0.0F : static_cast<float>(std::floor(random.uniform(-50, 400)));
  });
}

Eigen::Matrix3d turned(RandomStream& random) {
  Eigen::Vector4d q;
  for (double& part : q) part = random.normal();
  return Eigen::Quaterniond(q.normalized()).toRotationMatrix();
}

/// Reference for Siddon's sum: all crossings with voxel faces, sorted; the voxel at each segment's midpoint.
double plain_integral(const Volume& volume, const Vector3d& source, const Vector3d& direction) {
  const Eigen::Affine3d voxel_from_patient = volume.patient_from_voxel.inverse();
  const Vector3d start = voxel_from_patient * source;
  const Vector3d step = voxel_from_patient.linear() * direction;
  std::vector<double> crossings{0};
  for (int axis = 0; axis < 3; ++axis)
    for (int face = 0; face <= volume.size[axis]; ++face)
      if (step[axis] != 0) crossings.push_back(std::max(0.0, (face - 0.5 - start[axis]) / step[axis]));
  std::ranges::sort(crossings);
  double sum = 0;
  for (std::size_t i = 1; i < crossings.size(); ++i) {
    const Vector3d middle = start + 0.5 * (crossings[i] + crossings[i - 1]) * step;
    const Vector3i voxel = (middle.array() + 0.5).floor().cast<int>();
    if ((voxel.array() >= 0).all() && (voxel.array() < volume.size.array()).all())
      sum += (crossings[i] - crossings[i - 1]) *
             static_cast<double>(volume.voxels[index(volume.size, voxel.x(), voxel.y(), voxel.z())]);
  }
  return sum * direction.norm();
}

std::vector<float> integrals(const Absorber& absorber, const Vector3d& source,
                             std::span<const Vector3d> rays) {
  std::vector<float> sums(rays.size(), -1);
  absorber.integrate(source, rays, sums);
  return sums;
}

geometry::View view_from(const Vector3d& source, const Vector3d& aim, int width) {
  geometry::View view;
  view.intrinsics = {4.0 * width, 4.0 * width, 0.5 * (width - 1), 0.5 * (width - 1), 0};
  const Vector3d z = (aim - source).normalized();
  const Vector3d x = z.unitOrthogonal();
  view.camera_from_world.rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
  view.camera_from_world.translation = -(view.camera_from_world.rotation * source);
  return view;
}

TEST(Absorber, AgreesWithReferenceSumInAnyDirection) {
  Volume volume = noise_volume();
  RandomStream random(2, 900);
  for (int turn = 0; turn < 20; ++turn) {
    volume.patient_from_voxel = turned(random) * Vector3d(0.7, turn % 2 ? -1.1 : 1.1, 2).asDiagonal() *
                                Eigen::Translation3d(-5, -4, -7);
    const Absorber absorber(volume, {});
    const Vector3d source = 60 * turned(random).col(0);
    std::vector<Vector3d> rays;
    for (int i = 0; i < 101; ++i) {
      const Vector3d aim(random.uniform(-9, 9), random.uniform(-9, 9), random.uniform(-9, 9));
      rays.push_back((aim - source) * random.uniform(0.1, 10));
    }
    const std::vector<float> sums = integrals(absorber, source, rays);
    for (std::size_t i = 0; i < rays.size(); ++i)
      EXPECT_NEAR(sums[i], plain_integral(volume, source, rays[i]), 0.1)
          << turn << ' ' << i;  // of up to 8000
  }
}

TEST(Absorber, UniformBoxGivesTheChordLength) {
  const Volume volume = volume_of({20, 30, 40}, [](int, int, int) { return 3.0F; });
  const Absorber absorber(volume, {});
  const std::array<Vector3d, 5> rays = {Vector3d(0, 0, 2), Vector3d(0, 0, -1), Vector3d(0.1, 0, 1),
                                        Vector3d(0.1, 0.15, 1), Vector3d(1, 0, 1)};
  const std::vector<float> sums = integrals(absorber, {0, 0, -100}, rays);
  EXPECT_NEAR(sums[0], 3 * 40, 1e-3);
  EXPECT_EQ(sums[1], 0);  // the box is behind the source
  EXPECT_NEAR(sums[2], 3 * std::hypot(1, 0.1) * (100 - 80), 1e-3);
  EXPECT_NEAR(sums[3], 3 * std::hypot(1, 0.1, 0.15) * (100 - 80), 1e-3);
  EXPECT_EQ(sums[4], 0);
}

TEST(Absorber, BallGivesItsChordLengthsWithinVoxels) {
  const double radius = 50;
  const Volume volume = volume_of({128, 128, 128}, [&](int x, int y, int z) {
    return (Vector3d(x, y, z) - Vector3d::Constant(63.5)).norm() < radius ? 0.0F : -1000.0F;
  });
  const Absorber absorber(volume, {0.02, 0.02e-3, 0, 1, -900});
  double worst = 0, mean = 0;
  std::vector<Vector3d> rays;
  for (int i = 0; i < 400; ++i) rays.push_back({1, 0.0021 * i / 20, 0.003 * (i % 20) / 2});
  const Vector3d source(-600, 10, -8);
  const std::vector<float> sums = integrals(absorber, source, rays);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Vector3d unit = rays[i].normalized();
    const double off = source.cross(unit).norm();
    const double chord = 2 * std::sqrt(std::max(0.0, radius * radius - off * off));
    worst = std::max(worst, std::abs(sums[i] - 0.02 * chord));
    mean += (sums[i] - 0.02 * chord) / static_cast<double>(rays.size());
  }
  EXPECT_LT(worst, 0.02 * 5);
  EXPECT_NEAR(mean, 0, 0.02 * 0.2);
}

TEST(Absorber, PermutedAndFlippedVoxelsGiveTheSameVolume) {
  const Volume volume = noise_volume();
  const geometry::View view = view_from({300, 120, -90}, {0, 0, 0}, 48);
  const image::Image<float> expected = *drr(Absorber(volume, {}), view, 48, 48);
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (int flips = 0; flips < 8; ++flips) {
      Volume other;
      Eigen::Matrix4d old_from_new = Eigen::Matrix4d::Zero();
      old_from_new(3, 3) = 1;
      for (int axis = 0; axis < 3; ++axis) {
        const int old = order[static_cast<std::size_t>(axis)];
        const bool flip = flips >> axis & 1;
        other.size[axis] = volume.size[old];
        old_from_new(old, axis) = flip ? -1 : 1;
        old_from_new(old, 3) = flip ? volume.size[old] - 1 : 0;
      }
      other.voxels.resize(volume.voxels.size());
      for (int z = 0; z < other.size.z(); ++z)
        for (int y = 0; y < other.size.y(); ++y)
          for (int x = 0; x < other.size.x(); ++x) {
            const Vector3i from = (old_from_new * Eigen::Vector4d(x, y, z, 1)).head<3>().cast<int>();
            other.voxels[index(other.size, x, y, z)] =
                volume.voxels[index(volume.size, from.x(), from.y(), from.z())];
          }
      other.patient_from_voxel.matrix() = volume.patient_from_voxel.matrix() * old_from_new;
      const image::Image<float> got = *drr(Absorber(other, {}), view, 48, 48);
      for (std::size_t i = 0; i < got.pixels().size(); ++i)
        ASSERT_NEAR(got.pixels()[i], expected.pixels()[i], 0.05) << flips;
    }
  } while (std::ranges::next_permutation(order).found);
}

TEST(Absorber, EmptyMarginsChangeNothing) {
  const Volume volume = noise_volume();
  Volume bare = volume_of(
      {9, 7, 14}, [&](int x, int y, int z) { return volume.voxels[index(volume.size, x + 2, y, z)]; });
  bare.patient_from_voxel = volume.patient_from_voxel * Eigen::Translation3d(2, 0, 0);
  const geometry::View view = view_from({-20, 200, 31}, {0, 0, 0}, 32);
  EXPECT_THAT(drr(Absorber(volume, {}), view, 32, 32)->pixels(),
              testing::ElementsAreArray(drr(Absorber(bare, {}), view, 32, 32)->pixels()));
}

TEST(Absorber, EmptyVolumeAndSingleVoxel) {
  const std::array<Vector3d, 2> rays = {Vector3d(1, 0, 0), Vector3d(1, 1e-9, -1e-12)};
  const Volume air = volume_of({5, 5, 5}, [](int, int, int) { return -1000.0F; });
  EXPECT_THAT(integrals(Absorber(air, {1, 1e-3, 0, 9, -900}), {-10, 0, 0}, rays), testing::Each(0.0F));
  const Volume one = volume_of({1, 1, 1}, [](int, int, int) { return 7.0F; });
  EXPECT_THAT(integrals(Absorber(one, {}), {-10, 0, 0}, rays), testing::Each(testing::FloatNear(7, 1e-4F)));
}

TEST(Drr, ResultIsIndependentOfTheNumberOfThreads) {
  const Absorber absorber(noise_volume(), {});
  const geometry::View view = view_from({150, 140, 20}, {1, 0, 2}, 200);
  const image::Image<float> one = *drr(absorber, view, 200, 130, 1);
  const image::Image<float> five = *drr(Absorber(noise_volume(), {}, 3), view, 200, 130, 5);
  EXPECT_TRUE(std::ranges::equal(one.pixels(), five.pixels()));
}

TEST(Drr, SourceInsideIsRefused) {
  const Absorber absorber(noise_volume(), {});
  EXPECT_EQ(drr(absorber, view_from({1, 2, 3}, {0, 0, 0}, 8), 8, 8).error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::volume
