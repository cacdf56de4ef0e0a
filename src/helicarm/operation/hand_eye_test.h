// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/devices/tracker/hand_eye.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::operation {

/// A robot beside a tracker, with a marker on its tool and known transforms.
inline tracker::HandEye exact_hand_eye() {
  tracker::HandEye hand_eye;
  hand_eye.flange_from_marker = {geometry::rotation_from_euler(0.2, -0.4, 0.7), {12, 70, 40}};
  hand_eye.tracker_from_base = {geometry::rotation_from_euler(1, 0.3, -2), {300, 100, 1200}};
  hand_eye.covariance.setZero();
  return hand_eye;
}

}  // namespace helicarm::operation
