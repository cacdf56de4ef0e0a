// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

namespace helicarm::phantom {

/// The ball of 2.3.3 that may contain targets.
struct SurgicalSpace {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< mm, calibrator frame
  double radius_mm = 100;
};

/// Radius (mm) of the largest ball centred in the space that contains no point; never below the supremum by
/// more than the tolerance.
double largest_gap_mm(const std::vector<Eigen::Vector3d>& points, const SurgicalSpace& space = {},
                      double tolerance_mm = 0.01);

/// E(A) of Eq. 13: the largest gap over the standard deviation of the points. Small means uniform; infinite
/// if all points coincide.
double uniformity(const std::vector<Eigen::Vector3d>& points, const SurgicalSpace& space = {},
                  double tolerance_mm = 0.01);

}  // namespace helicarm::phantom
