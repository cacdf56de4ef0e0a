// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

namespace helicarm::simulation {

/// Reflecting discs on one flat side of a body: a camera sees all of them or none.
struct MarkerFacet {
  Eigen::Vector3d normal_in_body;                ///< outward, of unit length
  std::vector<Eigen::Vector3d> markers_in_body;  ///< mm; three or more, not on a line
};

/// What a tracker follows. Its frame is that of the pose the tracker gives.
struct TrackedBody {
  std::vector<MarkerFacet> facets;
};

/// The calibrator's four facets about its flange, three discs on each; frame = calibrator.
TrackedBody calibrator_markers();

/// A flat array of four discs, as screwed to a bone or clamped to a tool; origin in their middle, normal +z.
TrackedBody marker_array();

}  // namespace helicarm::simulation
