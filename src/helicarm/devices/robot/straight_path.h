// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "helicarm/geometry/rotation.h"

namespace helicarm::robot {

/// Path of a movel: the tip in a straight line, the rotation in proportion.
class StraightPath {
 public:
  StraightPath(const geometry::RigidTransform& from, const geometry::RigidTransform& to)
      : from_(from),
        shift_(to.translation - from.translation),
        turn_(geometry::vector_from_rotation(from.rotation.transpose() * to.rotation)) {}

  double shift_mm() const { return shift_.norm(); }
  double turn() const { return turn_.norm(); }  ///< rad
  /// Length that speed and acceleration refer to, mm: the translation, or the arc of the rotation at a radius
  /// of 200 mm, if longer.
  double length_mm() const { return std::max(shift_mm(), 200 * turn()); }

  /// `part` is 0 to 1.
  geometry::RigidTransform at(double part) const {
    return {from_.rotation * geometry::rotation_from_vector(part * turn_), from_.translation + part * shift_};
  }

 private:
  geometry::RigidTransform from_;
  Eigen::Vector3d shift_;
  Eigen::Vector3d turn_;
};

/// Time for a length from rest to rest, s.
inline double duration_s(double length_mm, double speed_mm_s, double acceleration_mm_s2) {
  const double ramp_mm = speed_mm_s * speed_mm_s / acceleration_mm_s2;
  if (length_mm < ramp_mm) return 2 * std::sqrt(length_mm / acceleration_mm_s2);
  return length_mm / speed_mm_s + speed_mm_s / acceleration_mm_s2;
}

}  // namespace helicarm::robot
