// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/failure.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm {

/// A point of the bone, touched with the pointer after the marker was fixed and again from time to time.
struct CheckPoint {
  Eigen::Vector3d point_in_bone;  ///< mm, as touched first
  double limit_mm = 1;            ///< beyond, the marker has been bumped: touching repeats to a few tenths
};

/// How far the tip is from where the bone's marker has the point, mm. Refuses `residual_too_large` over the
/// limit.
inline Expected<double> check_point_off_mm(const CheckPoint& check, const RigidTransform& tracker_from_bone,
                                           const Eigen::Vector3d& tip_in_tracker) {
  const double off = (tracker_from_bone * check.point_in_bone - tip_in_tracker).norm();
  if (off <= check.limit_mm) return off;
  return fail(Reason::residual_too_large,
              "the check point is not where the bone's marker has it: the marker moved",
              {{"off_mm", off}, {"limit_mm", check.limit_mm}});
}

}  // namespace helicarm
