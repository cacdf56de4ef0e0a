// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/density.h"

#include <gmock/gmock.h>

#include "helicarm/geometry/rotation.h"
#include "helicarm/registration/motion.h"

namespace helicarm::registration {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

/// A lopsided smooth body on an anisotropic, oblique grid.
Density smooth_body() {
  Density density;
  density.size = {24, 30, 20};
  density.model_from_voxel.linear() =
      geometry::rotation_from_vector(Vector3d(0.1, -0.2, 0.3)) * Vector3d(1.0, 0.8, 1.3).asDiagonal();
  density.model_from_voxel.translation() = Vector3d(-12, -10, -11);
  density.values.assign(std::size_t{24} * 30 * 20, 0);
  for (int z = 1; z < 19; ++z)
    for (int y = 1; y < 29; ++y)
      for (int x = 1; x < 23; ++x) {
        const double r2 =
            std::pow((x - 10) / 6.0, 2) + std::pow((y - 16) / 7.0, 2) + std::pow((z - 9) / 4.0, 2);
        density.values[density.index(x, y, z)] = static_cast<float>(std::exp(-2 * r2) * (1 + 0.05 * x));
      }
  return density;
}

float integral_after(const Density& density, const geometry::RigidTransform& pose, const Vector3d& centre,
                     const Vector3d& source, const Vector3d& direction, const AffineMotion& motion) {
  // The moved model seen from the source: p' = p + t + B (p - c), so model points follow the affine map.
  Eigen::Affine3d moved = Eigen::Affine3d::Identity();
  Eigen::Matrix3d linear;
  for (int i = 0; i < 3; ++i) linear.row(i) = motion.segment<3>(3 + 3 * i).transpose();
  moved.linear() += linear;
  moved.translation() = motion.head<3>() - linear * centre;
  Eigen::Affine3d world_from_model = Eigen::Affine3d::Identity();
  world_from_model.linear() = pose.rotation;
  world_from_model.translation() = pose.translation;
  Density there = density;
  there.model_from_voxel = moved * world_from_model * density.model_from_voxel;
  return PosedDensity(there, {}, source, centre).integrate(direction);
}

class RayDerivatives : public testing::TestWithParam<Vector3d> {};

TEST_P(RayDerivatives, AgreeWithFiniteDifferences) {
  const Density density = smooth_body();
  const geometry::RigidTransform pose{geometry::rotation_from_vector(Vector3d(0.3, 0.1, -0.2)), {2, -1, 3}};
  const Vector3d centre(1, 2, 1.5);
  const Vector3d source = 400 * GetParam().normalized();
  for (const Vector3d& aim : {Vector3d(0, 1, 1), Vector3d(4, -2, 0), Vector3d(-3, 3, -4)}) {
    const Vector3d direction = (aim - source).normalized();
    const RayIntegral integral = PosedDensity(density, pose, source, centre).differentiate(direction);
    EXPECT_NEAR(integral.value, PosedDensity(density, pose, source, centre).integrate(direction), 1e-4);
    for (int k = 0; k < affine_parameters; ++k) {
      const double step = k < 3 ? 0.01 : 0.001;
      const AffineMotion motion = step * AffineMotion::Unit(k);
      const double slope = (integral_after(density, pose, centre, source, direction, motion) -
                            integral_after(density, pose, centre, source, direction, -motion)) /
                           (2 * step);
      EXPECT_NEAR(integral.by_motion[k], slope, 0.01 + 0.01 * std::abs(slope)) << k;
    }
  }
}

TEST(EightRays, EqualSingleOnes) {
  const Density density = smooth_body();
  const geometry::RigidTransform pose{geometry::rotation_from_vector(Vector3d(0.3, 0.1, -0.2)), {2, -1, 3}};
  for (const Vector3d& source : {Vector3d(300, 20, 10), Vector3d(250, 250, 1), Vector3d(5, -280, 30)}) {
    const PosedDensity posed(density, pose, source, Vector3d::Zero());
    std::array<Vector3d, 8> directions;
    for (int i = 0; i < 8; ++i)
      directions[std::size_t(i)] = (Vector3d(i - 3, 4 * i - 14, 2.5 * i - 9) - source).normalized();
    std::array<float, 8> values;
    posed.integrate_eight(directions, values);
    std::array<RayIntegral, 8> integrals;
    posed.differentiate_eight(directions, integrals);
    for (std::size_t i = 0; i < 8; ++i) {
      EXPECT_NEAR(values[i], posed.integrate(directions[i]), 2e-4) << i;
      const RayIntegral alone = posed.differentiate(directions[i]);
      EXPECT_NEAR(integrals[i].value, alone.value, 2e-4) << i;
      EXPECT_LT((integrals[i].by_motion - alone.by_motion).cwiseAbs().maxCoeff(),
                1e-3F * (1 + alone.by_motion.cwiseAbs().maxCoeff()))
          << i;
    }
  }
}

TEST(EightRays, SeeTheSameWithEmptyBlocksMarked) {
  Density density = smooth_body();
  density.size = {64, 70, 60};
  density.values.assign(std::size_t{64} * 70 * 60, 0);
  for (const Vector3i& speck :
       {Vector3i(8, 8, 8), Vector3i(7, 40, 31), Vector3i(33, 16, 55), Vector3i(20, 63, 24)})
    density.values[density.index(speck.x(), speck.y(), speck.z())] = 1;
  Density marked = density;
  mark_blocks(marked);
  const geometry::RigidTransform pose{geometry::rotation_from_vector(Vector3d(0.3, 0.1, -0.2)), {2, -1, 3}};
  int hits = 0;
  for (const Vector3d& source : {Vector3d(300, 20, 10), Vector3d(5, -280, 30), Vector3d(20, 30, 320)})
    for (const Vector3i& speck :
         {Vector3i(8, 8, 8), Vector3i(7, 40, 31), Vector3i(33, 16, 55), Vector3i(20, 63, 24)}) {
      const Vector3d aim = pose * (density.model_from_voxel * speck.cast<double>());
      std::array<Vector3d, 8> directions;
      for (int i = 0; i < 8; ++i)
        directions[std::size_t(i)] = (aim + Vector3d(i - 3.5, 3.5 - i, 0.8 * i - 3) - source).normalized();
      std::array<float, 8> all, some;
      PosedDensity(density, pose, source, Vector3d::Zero()).integrate_eight(directions, all);
      PosedDensity(marked, pose, source, Vector3d::Zero()).integrate_eight(directions, some);
      EXPECT_EQ(all, some);
      for (const float value : all) hits += value > 0;
    }
  EXPECT_GT(hits, 12);
}

INSTANTIATE_TEST_SUITE_P(AlongEachAxis, RayDerivatives,
                         testing::Values(Vector3d(1, 0.2, 0.1), Vector3d(0.1, -1, 0.2), Vector3d(0.2, 0.1, 1),
                                         Vector3d(-1, 0.9, 0.1)));

TEST(CoarserDensity, KeepsMassAndMiddle) {
  const Density fine = smooth_body();
  const Density coarse = coarser(fine, 2.5);
  EXPECT_LT(coarse.size.prod(), fine.size.prod() / 4);
  const auto moments = [](const Density& density) {
    double mass = 0;
    Vector3d sum = Vector3d::Zero();
    for (int z = 0; z < density.size.z(); ++z)
      for (int y = 0; y < density.size.y(); ++y)
        for (int x = 0; x < density.size.x(); ++x) {
          const double value = density.values[density.index(x, y, z)];
          mass += value;
          sum += value * (density.model_from_voxel * Vector3d(x, y, z));
        }
    return std::pair(mass * std::abs(density.model_from_voxel.linear().determinant()), Vector3d(sum / mass));
  };
  const auto [fine_mass, fine_middle] = moments(fine);
  const auto [coarse_mass, coarse_middle] = moments(coarse);
  EXPECT_NEAR(coarse_mass, fine_mass, 1e-3 * fine_mass);
  EXPECT_LT((coarse_middle - fine_middle).norm(), 1e-3);
}

}  // namespace
}  // namespace helicarm::registration
