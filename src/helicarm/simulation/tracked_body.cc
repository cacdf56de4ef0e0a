// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/tracked_body.h"

#include <Eigen/Geometry>

namespace helicarm::simulation {

using Eigen::Vector3d;

// The paper shows four facets without dimensions; these avoid the flange and the beam to the balls.
TrackedBody calibrator_markers() {
  TrackedBody body;
  for (int side = 0; side < 4; ++side) {
    const Eigen::AngleAxisd turn(side * EIGEN_PI / 2, Vector3d::UnitZ());
    body.facets.push_back(
        {turn * Vector3d::UnitX(),
         {turn * Vector3d(85, -40, -10), turn * Vector3d(85, 40, -10), turn * Vector3d(85, 0, 40)}});
  }
  return body;
}

TrackedBody marker_array() {
  // All side lengths differ, so that a tracker cannot confuse the discs.
  const std::vector<Vector3d> detections = {{-45, -30, 0}, {40, -38, 0}, {32, 44, 0}, {-27, 24, 0}};
  return {{{Vector3d::UnitZ(), detections}}};
}

}  // namespace helicarm::simulation
