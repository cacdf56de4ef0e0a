// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/check_point.h"

#include <gtest/gtest.h>

#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace check_point_test {

const CheckPoint check{{10, 20, 30}};
const geometry::RigidTransform tracker_from_bone{geometry::rotation_from_vector({0.3, 1, -0.2}),
                                                 {100, 0, 900}};

TEST(CheckPoint, UnmovedMarkerIsWithinTheLimit) {
  const Eigen::Vector3d touched = tracker_from_bone * check.point_in_bone + Eigen::Vector3d(0.3, 0, 0);
  EXPECT_NEAR(check_point_off_mm(check, tracker_from_bone, touched).value(), 0.3, 1e-9);
}

TEST(CheckPoint, MovedMarkerIsRefused) {
  const Eigen::Vector3d touched = tracker_from_bone * check.point_in_bone;
  const geometry::RigidTransform bumped =
      tracker_from_bone * geometry::RigidTransform{geometry::rotation_from_vector({0, 0.05, 0}), {0, 0, 0}};
  const auto off = check_point_off_mm(check, bumped, touched);
  ASSERT_FALSE(off);
  EXPECT_EQ(off.error().reason, Reason::residual_too_large);
  EXPECT_GT(off.error().figures.at("off_mm"), 1);
}

}  // namespace check_point_test
}  // namespace helicarm::tracker
