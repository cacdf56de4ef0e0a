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
  fill_cavities(grid, ChamferSteps(Eigen::Matrix3d::Identity()), gap_mm, outside, {});
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
