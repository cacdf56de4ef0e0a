// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/registration/estimate.h"

namespace helicarm::registration {

/// A linearised solution over some parameters of the affine motion (columns of `map`).
struct Linearised {
  Eigen::MatrixXd information;  ///< H, prior included
  Eigen::VectorXd gradient;     ///< of the comparisons
  Eigen::MatrixXd meat;         ///< covariance of the gradient
  double clusters = 0;          ///< independent comparisons, about

  Eigen::MatrixXd covariance() const;  ///< H^-1 meat H^-1
};

/// What is solved for.
struct Problem {
  std::vector<bool> views = {};                         ///< that take part; empty: all
  Eigen::MatrixXd map = affine_from_rigid();            ///< 12 x n, affine motion from the n unknowns
  Eigen::MatrixXd prior = Eigen::MatrixXd::Zero(6, 6);  ///< information, n x n
};

/// Sums over the problem's views. Residuals of comparisons near each other in an image are correlated,
/// because the model errs there alike: the meat is summed over pairs with a Bartlett kernel of
/// `correlation_px` (Conley 1999), one for each view.
Linearised linearised(const Observation& observation, const Problem& problem,
                      const std::vector<double>& correlation_px);

/// Standard deviations of an error common to the edges of a view, mm at the model.
struct EdgeSigma {
  double shift_mm;    ///< along each axis of the image
  double outward_mm;  ///< of a growth about the centre, at the model's radius
};

/// Errors of a solution: residuals, cameras, edges of the model.
struct ErrorModel {
  const std::vector<RegistrationView>& views;
  double radius_mm;         ///< of the model
  Eigen::MatrixXd cameras;  ///< 11 n x 11 n, as `calibration::Calibration::joint_covariance`
  std::vector<double> correlation_px;
  EdgeSigma edge;
  double scale_sigma = 0;  ///< relative, of the model's size

  /// Of the unknowns (a pose: about `centre`). `sum`: the problem, linearised.
  Eigen::MatrixXd covariance(const Observation& observation, const Eigen::Vector3d& centre,
                             const Problem& problem, const Linearised& sum) const;
  Eigen::MatrixXd covariance(const Observation& observation, const Eigen::Vector3d& centre,
                             const Problem& problem = {}) const;
  Eigen::MatrixXd of_cameras(const Observation& observation, const Eigen::Vector3d& centre,
                             const Problem& problem = {}) const;
  Eigen::MatrixXd of_edges(const Observation& observation, const Eigen::Vector3d& centre,
                           const Problem& problem = {}) const;
  /// Error of the unknowns per relative error of the model's size: a body larger than its model by s is found
  /// s times this away. Not part of `covariance`.
  Eigen::VectorXd by_size(const Observation& observation, const Problem& problem = {}) const;
};

/// Local shifts (full-resolution pixels) that the comparisons of a view still ask for, each along its own
/// best determined direction; root mean square by weight.
double local_shift_px(const ViewObservation& view, const geometry::View& camera,
                      const Eigen::Vector3d& centre);

}  // namespace helicarm::registration
