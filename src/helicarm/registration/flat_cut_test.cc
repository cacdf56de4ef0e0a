// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/flat_cut.h"

#include <gtest/gtest.h>

#include "helicarm/registration/surface_scene_test.h"

namespace helicarm::registration {
namespace flat_cut_test {

using Eigen::Vector3d;

/// A shaft of 8 mm radius with a round end, which a plane across `axis` cuts off.
Surface shaft_cut_across(const Vector3d& axis) {
  const auto distance = [&](const Vector3d& p) {
    const double along = std::clamp(p.x(), -60.0, 10.0);
    return std::max((p - Vector3d(along, 0, 0)).norm() - 8, -axis.normalized().dot(p) - 10);
  };
  return *prepare_surface(phantom::surface_of(distance, {Vector3d(-20, -14, -14), Vector3d(22, 14, 14)}, 0.6),
                          "shaft");
}

TEST(FlatCut, IsWhereAPlaneCutsABoneOff) {
  for (const Vector3d& axis : {Vector3d(1, 0, 0), Vector3d(1, 0.3, -0.2)}) {
    const auto points = flat_cut(shaft_cut_across(axis));
    EXPECT_GT(points.size(), 100U);
    for (const Vector3d& point : points) EXPECT_NEAR(axis.normalized().dot(point), -10, 0.1);
  }
}

TEST(FlatCut, AWholeBoneHasNone) {
  EXPECT_TRUE(flat_cut(*prepare_surface(lopsided_surface(), "bone")).empty());
  EXPECT_TRUE(flat_cut(*prepare_surface(stepped_surface(), "mask")).empty());
}

}  // namespace flat_cut_test
}  // namespace helicarm::registration
