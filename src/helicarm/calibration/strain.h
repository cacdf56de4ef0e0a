// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/refine.h"

namespace helicarm::calibration {

/// Volume-preserving strain of the calibrator that best explains the views, to first order about the fit with
/// the file's coordinates.
struct Strain {
  Eigen::Matrix3d strain =
      Eigen::Matrix3d::Zero();                      ///< point = centre + (1 + strain) (file's point - centre)
  double chi2_gain = 0;                             ///< decrease of chi2 for five degrees of freedom
  double extension = 0;                             ///< eigenvalue of largest magnitude, relative
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< its eigenvector, calibrator frame
  double sigma = 0;  ///< of the extension, relative, for the least observable strain
};

/// `problems` are those of `fit`. The change of volume is excluded: it is not distinguishable from the source
/// distance.
Strain strain_of(const std::vector<ViewProblem>& problems, const Refinement& fit);

}  // namespace helicarm::calibration
