// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/calibration/refine.h"
#include "helicarm/geometry/dlt.h"

namespace helicarm::calibration {

std::vector<geometry::PointPair> pairs_of(const std::vector<fiducials::Fiducial>& fiducials);

/// For each fiducial, how its position follows from independent unit errors.
struct OffsetRoots {
  std::vector<Eigen::Matrix3Xd> of_ball;  ///< empty: exact
  bool joint = false;                     ///< all have the same errors

  /// Where those of `ball` begin.
  Eigen::Index first(std::size_t ball) const { return joint ? 0 : 3 * Eigen::Index(ball); }
  /// Orthonormal columns (3n x unit errors): with their transpose these errors follow from unit errors of the
  /// fiducials' coordinates by the symmetric root of their covariance, which is the same on every machine.
  Eigen::MatrixXd directions() const;
};

OffsetRoots offset_roots(const CommonPrior& common);

/// The used fiducials as observations, with the errors of their positions and of the map, and a start.
Expected<ViewProblem> problem_of(const ViewFiducials& view, const OffsetRoots& roots);

}  // namespace helicarm::calibration
