// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/registration/motion.h"

namespace helicarm::migration {

/// A marker in both examinations.
struct Pair {
  Eigen::Vector3d first, second;  ///< mm
  Eigen::Matrix3d spread;         ///< mm^2, of `second` less the moved `first`, in the second's axes
};

/// The motion of a rigid set of markers by least squares (Soderkvist and Wedin 1993).
struct RigidFit {
  geometry::RigidTransform second_from_first;
  Eigen::Vector3d centre;                    ///< of the markers, second examination
  registration::RigidCovariance covariance;  ///< about `centre`, as RigidStep: of the markers' spreads
  std::vector<double> residual_mm;           ///< per marker
  double mean_error_mm = 0;                  ///< mean error of rigid-body fitting: mean of the residuals
  double squares_mm2 = 0;                    ///< of the residuals
  double expected_squares_mm2 = 0;           ///< by the spreads
  double squares_variance_mm4 = 0;           ///< of the squares, by the spreads of normal errors
};

/// Three pairs or more that are not on one line.
RigidFit fit_rigid(const std::vector<Pair>& pairs);

}  // namespace helicarm::migration
