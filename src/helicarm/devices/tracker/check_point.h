// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/failure.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::tracker {

/// A point of the bone, touched with the pointer after fixing the marker and again at intervals.
struct CheckPoint {
  Eigen::Vector3d point_in_bone;  ///< mm, as first touched
  double limit_mm = 1;  ///< beyond it the marker has moved; touching repeats to a few tenths of a mm
};

/// Distance of the tip from the point's position by the bone's marker, mm. Refuses `residual_too_large` above
/// the limit.
inline Expected<double> check_point_off_mm(const CheckPoint& check,
                                           const geometry::RigidTransform& tracker_from_bone,
                                           const Eigen::Vector3d& tip_in_tracker) {
  const double off = (tracker_from_bone * check.point_in_bone - tip_in_tracker).norm();
  if (off <= check.limit_mm) return off;
  return fail(Reason::residual_too_large,
              "the check point's position differs from the recorded one: the bone's marker moved; start a "
              "new operation",
              {{"off_mm", off}, {"limit_mm", check.limit_mm}});
}

}  // namespace helicarm::tracker
