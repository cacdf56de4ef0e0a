// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"

namespace helicarm::phantom_calibration {

/// A distance between two fiducials' centres, measured by hand.
struct CentreDistance {
  std::size_t a, b;
  double mm;
  double sigma_mm;
};

/// Points with their joint covariance (3n x 3n, mm^2), and the relative error of their scale that is in it.
struct ScaledPoints {
  std::vector<Eigen::Vector3d> centres;
  Eigen::MatrixXd covariance_mm2;
  double scale_sigma = 0;
  double chi2 = 0;  ///< of the distances that gave the scale
};

/// Points whose covariance leaves the scale out (inner constraints), brought to scale `factor`, whose
/// relative error is `sigma`.
ScaledPoints scaled_by(const std::vector<Eigen::Vector3d>& centres, const Eigen::MatrixXd& covariance_mm2,
                       double factor, double sigma);

/// Brought to scale by distances, which also correct the shape as far as they know better: generalised least
/// squares. `distances_disagree` where they contradict each other (chi-square beyond its 99.9th percentile),
/// naming the pair that disagrees most.
Expected<ScaledPoints> scaled_by(const std::vector<Eigen::Vector3d>& centres,
                                 const Eigen::MatrixXd& covariance_mm2,
                                 const std::vector<CentreDistance>& distances,
                                 const std::vector<std::string>& labels);

/// With a further relative error of the scale, independent of the others.
ScaledPoints with_scale_error(ScaledPoints points, double sigma);

/// A scale compared with another one.
struct ScaleComparison {
  std::string scale;       ///< what gave the compared scale, for the message
  std::string other;       ///< what gave the other
  double ratio = 1;        ///< compared over other
  double sigma = 0;        ///< relative, of both together
  std::string correction;  ///< what another reading of the input is, and its ratio: where it agrees better
  std::optional<double> corrected_ratio = {};
};

/// Whether it is a contradiction: beyond three sigma, or beyond two where another reading agrees clearly
/// better.
bool is_contradiction(const ScaleComparison& comparison);

/// `scale_disagrees` beyond ten sigma, a warning where it is a contradiction.
Expected<void> check_scale(const ScaleComparison& comparison, std::vector<Warning>& warnings);

struct PairToMeasure {
  std::size_t a = 0, b = 0;
  double distance_mm = 0;
  double relative_sigma = 0;  ///< of the scale that it would give
};

/// The pair whose distance, measured with `sigma_mm`, gives the best scale.
PairToMeasure best_pair(const std::vector<Eigen::Vector3d>& centres, const Eigen::MatrixXd& covariance_mm2,
                        double sigma_mm);

}  // namespace helicarm::phantom_calibration
