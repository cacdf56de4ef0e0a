// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/phantom_check.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace helicarm::fiducials {
namespace {

phantom::Calibrator calibrator_of(const std::vector<Eigen::Vector3d>& centres) {
  phantom::Calibrator calibrator{"test", {}, {}};
  for (const Eigen::Vector3d& centre : centres)
    calibrator.balls.push_back({fmt::format("B{}", calibrator.balls.size() + 1), centre, 4});
  return calibrator;
}

/// Eight balls that equal themselves after half a turn about z, but not in a mirror.
phantom::Calibrator half_turned() {
  std::vector<Eigen::Vector3d> centres;
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(40, 5, 0), {25, 30, 20}, {-10, 38, 45}, {33, -12, 60}}) {
    centres.push_back(p);
    centres.push_back({-p.x(), -p.y(), p.z()});
  }
  return calibrator_of(centres);
}

phantom::Calibrator mirrored_in_x() {
  std::vector<Eigen::Vector3d> centres;
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(40, 5, 0), {25, 30, 20}, {10, 38, 45}, {33, -12, 60}}) {
    centres.push_back(p);
    centres.push_back({-p.x(), p.y(), p.z()});
  }
  return calibrator_of(centres);
}

TEST(NearSymmetry, HalfTurnIsFound) {
  const auto rotation = near_symmetry(half_turned(), false);
  ASSERT_TRUE(rotation);
  EXPECT_LT(rotation->rms_mm, 1e-9);
  EXPECT_NEAR(rotation->turn_deg, 180, 1e-6);
  EXPECT_EQ(rotation->moves.size(), 8u);
  EXPECT_FALSE(near_symmetry(half_turned(), true));
}

TEST(NearSymmetry, ReflectionIsFound) {
  ASSERT_TRUE(near_symmetry(mirrored_in_x(), true));
  EXPECT_FALSE(near_symmetry(mirrored_in_x(), false));
}

TEST(NearSymmetry, OfTheBuiltInCalibratorIsNone) {
  EXPECT_FALSE(near_symmetry(phantom::udcsc(), false));
  EXPECT_FALSE(near_symmetry(phantom::udcsc(), true));
}

TEST(PhantomCheck, SymmetricPhantomsAreAmbiguousFromEveryDirection) {
  const PhantomCheckOptions few{.directions = 6};
  for (const auto& calibrator : {half_turned(), mirrored_in_x()}) {
    const PhantomCheck check = check_phantom(calibrator, few);
    EXPECT_EQ(check.refused(), 6u);
  }
}

TEST(PhantomCheck, BuiltInCalibratorIsLabelledFromMostDirections) {
  const PhantomCheck check = check_phantom(phantom::udcsc(), {.directions = 12});
  EXPECT_LE(check.refused(), 1u);
}

TEST(PhantomCheck, BallsThatHideEachOtherAreNamed) {
  phantom::Calibrator calibrator = phantom::udcsc();
  const Eigen::Vector3d at = calibrator.balls[2].centre_in_calibrator;
  calibrator.balls.push_back({"X", at + Eigen::Vector3d(0, 0, 6), 4});
  const PhantomCheck check = check_phantom(calibrator, {.directions = 20});
  ASSERT_FALSE(check.hiding.empty());
  EXPECT_EQ(check.hiding.front().a, "P3");
  EXPECT_EQ(check.hiding.front().b, "X");
}

}  // namespace
}  // namespace helicarm::fiducials
