// SPDX-License-Identifier: Apache-2.0
#include "helicarm/segmentation/cavities.h"

#include <gtest/gtest.h>

namespace helicarm::segmentation {
namespace {

using Eigen::Vector3i;

/// A box with walls of one voxel from 5 to 15, open at its faces where `open` holds.
template <class Open>
volume::ByteGrid box(const Open& open) {
  volume::ByteGrid grid = volume::byte_grid({21, 21, 21});
  grid.each([&](const Vector3i& at) {
    const int outermost = (at - Vector3i::Constant(10)).cwiseAbs().maxCoeff();
    if (outermost == 5 && !open(at)) grid.values[grid.index(at)] = dense;
  });
  return grid;
}

std::size_t filled(volume::ByteGrid grid, double gap_mm, const std::vector<std::uint32_t>& outside = {}) {
  fill_cavities(grid, Eigen::Matrix3d::Identity(), gap_mm, outside, {});
  std::size_t count = 0;
  for (const std::uint8_t value : grid.values) count += value == cavity;
  return count;
}

TEST(FillCavities, OfAClosedWall) {
  const auto closed = box([](const Vector3i&) { return false; });
  EXPECT_EQ(filled(closed, 0), 729U);
  EXPECT_EQ(filled(closed, 1), 729U);
}

TEST(FillCavities, BehindANarrowGap) {
  const auto slit = box([](const Vector3i& at) { return at.x() == 5 && at.y() == 10; });
  EXPECT_EQ(filled(slit, 0), 0U);
  EXPECT_NEAR(double(filled(slit, 1)), 729, 12);
}

TEST(FillCavities, NotBehindAWideGap) {
  const auto window = box([](const Vector3i& at) { return at.x() == 5 && std::abs(at.y() - 10) <= 3; });
  EXPECT_LT(filled(window, 1), 20U);
}

TEST(FillCavities, ReachTheFaceThatCutsThemOff) {
  volume::ByteGrid tube = volume::byte_grid({15, 15, 10});
  tube.each([&](const Vector3i& at) {
    if (std::max(std::abs(at.x() - 7), std::abs(at.y() - 7)) == 4) tube.values[tube.index(at)] = dense;
  });
  EXPECT_EQ(filled(tube, 1), 490U);
}

TEST(FillCavities, AirInTheMarrowAtTheFaceIsNotOutside) {
  volume::ByteGrid tube = volume::byte_grid({15, 15, 10});
  tube.each([&](const Vector3i& at) {
    if (std::max(std::abs(at.x() - 7), std::abs(at.y() - 7)) == 4) tube.values[tube.index(at)] = dense;
  });
  const auto in_the_marrow = static_cast<std::uint32_t>(tube.index({7, 7, 9}));
  EXPECT_EQ(filled(tube, 1, {0, in_the_marrow}), 490U);
  EXPECT_EQ(filled(tube, 0, {0, in_the_marrow}), 490U);
}

TEST(FillCavities, PoresOfCancellousBoneBehindAHole) {
  volume::ByteGrid spongy = box([](const Vector3i& at) { return at == Vector3i(5, 10, 10); });
  spongy.each([&](const Vector3i& at) {
    const bool inside = (at - Vector3i::Constant(10)).cwiseAbs().maxCoeff() < 5;
    // Bars along all three axes, one voxel apart.
    if (inside && (at.x() % 2 == 0) + (at.y() % 2 == 0) + (at.z() % 2 == 0) <= 1)
      spongy.values[spongy.index(at)] = dense;
  });
  EXPECT_LT(filled(spongy, 0), 1U);
  EXPECT_GT(filled(spongy, 1), 300U);
}

TEST(FillCavities, NotTheSpaceOfAJoint) {
  volume::ByteGrid joint = volume::byte_grid({31, 31, 21});
  joint.each([&](const Vector3i& at) {
    const bool beside = std::max(std::abs(at.x() - 15), std::abs(at.y() - 15)) <= 10;
    if (beside && std::abs(at.z() - 10) > 1 && std::abs(at.z() - 10) < 6)
      joint.values[joint.index(at)] = dense;
  });
  EXPECT_EQ(filled(joint, 1), 0U);  // 3 mm
  EXPECT_EQ(filled(joint, 2), 0U);
}

TEST(FillCavities, AnOpenSideAtAFaceIsClosedWhereTheOutsideIsKnown) {
  volume::ByteGrid trough = volume::byte_grid({15, 15, 10});
  trough.each([&](const Vector3i& at) {
    if (at.x() >= 6 && std::max(std::abs(at.x() - 10), std::abs(at.y() - 7)) == 4)
      trough.values[trough.index(at)] = dense;
  });
  trough.each([&](const Vector3i& at) {
    if (at.x() == 14 && std::abs(at.y() - 7) < 4) trough.values[trough.index(at)] = empty;
  });
  EXPECT_EQ(filled(trough, 1), 0U);
  EXPECT_NEAR(double(filled(trough, 1, {0})), 7 * 8 * 10, 5);
}

}  // namespace
}  // namespace helicarm::segmentation
