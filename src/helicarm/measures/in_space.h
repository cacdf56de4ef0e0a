// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "helicarm/geometry/view.h"
#include "helicarm/measures/measure.h"

namespace helicarm::measures {

/// A landmark or another point of a bone, in the bone's own coordinates, mm, such as a CT's. The name is a
/// role's word, an end of the bone's axis, or that of a further point.
struct Landmark {
  std::string name;
  Eigen::Vector3d at;
  Eigen::Matrix3d covariance_mm2;  ///< zero: exact
};

/// Ends of the axis along which a true lateral image would be taken: points that coincide in it, such as both
/// condyles' posterior borders, or the plateau's margins.
inline constexpr std::string_view axis_medial = "axis_medial", axis_lateral = "axis_lateral";

/// `femoral_quadrants` and `tibia_ap` in the parallel projection along that axis, the lateral image without
/// its errors of direction and magnification; `tibia_ml` along the plateau's width. Lengths are in mm. The
/// covariances hold the landmarks' errors, the axis' too.
/// Refuses as `measure`, and (bad_value) other kinds, an axis that is missing or shorter than 10 mm.
Expected<Measure> measure_in_space(Kind kind, std::span<const Landmark> landmarks);

/// How far a view is from a true lateral image of a bone.
struct Lateral {
  double off_deg;   ///< between the ray to the axis' middle and the axis, 0 to 90
  double apart_mm;  ///< between the images of the axis' ends, in the plane through its middle
};

/// The axis' ends in the view's world. Refuses `behind_source`.
Expected<Lateral> lateral_of(const geometry::View& view, const Eigen::Vector3d& medial,
                             const Eigen::Vector3d& lateral);

}  // namespace helicarm::measures
