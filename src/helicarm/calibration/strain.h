// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/refine.h"

namespace helicarm {

/// How the calibrator would have to be stretched, without change of volume, to fit the views best: to first
/// order about a fit with the calibrator as in its file.
struct Strain {
  Eigen::Matrix3d strain =
      Eigen::Matrix3d::Zero();                      ///< place = centre + (1 + strain) (file's place - centre)
  double chi2_gain = 0;                             ///< what it takes from chi2, for five degrees of freedom
  double extension = 0;                             ///< its eigenvalue of largest amount, relative
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();  ///< of that, in the calibrator
  double sigma = 0;  ///< of an extension, relative, for the strain that the views show least
};

/// `problems` are those of `fit`. The change of volume is left out: a larger calibrator farther away looks
/// the same.
Strain strain_of(const std::vector<ViewProblem>& problems, const Refinement& fit);

}  // namespace helicarm
