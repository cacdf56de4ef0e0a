// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/geometry/view.h"

namespace helicarm::track {

/// Two cameras at right angles, 800 mm from the origin, of 2 px per mm there.
inline std::vector<geometry::View> two_cameras() {
  geometry::View first, second;
  first.intrinsics = second.intrinsics = {1600, 1600, 250, 250, 0};
  first.camera_from_world.rotation << 1, 0, 0, 0, 0, -1, 0, 1, 0;
  second.camera_from_world.rotation << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  first.camera_from_world.translation = second.camera_from_world.translation = {0, 0, 800};
  return {first, second};
}

}  // namespace helicarm::track
