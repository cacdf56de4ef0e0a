// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

namespace helicarm::simulation {

/// Reflecting discs on one flat side of a body: visible all together or not at all.
struct MarkerFacet {
  Eigen::Vector3d normal_in_body;                ///< outward, of unit length
  std::vector<Eigen::Vector3d> markers_in_body;  ///< mm; three or more, not on a line
};

/// A tracked body. Its frame is the frame of the tracker's pose.
struct TrackedBody {
  std::vector<MarkerFacet> facets;
};

/// The calibrator's four facets about its flange, three discs each; frame = calibrator.
TrackedBody calibrator_markers();

/// A flat array of four discs for a bone or a tool; origin at their centroid, normal +z.
TrackedBody marker_array();

}  // namespace helicarm::simulation
