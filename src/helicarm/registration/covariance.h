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

/// Sums over views (empty: all). Residuals of comparisons near each other in an image are correlated, because
/// the model errs there alike: the meat is summed over pairs with a Bartlett kernel of `correlation_px`
/// (Conley 1999), one for each view. `prior`: information added.
Linearised linearised(const Observation& observation, const std::vector<bool>& views,
                      const Eigen::MatrixXd& map, const Eigen::MatrixXd& prior,
                      const std::vector<double>& correlation_px);

/// Which views take part (empty: all), and the prior's information.
struct Part {
  std::vector<bool> views = {};
  RigidCovariance prior = RigidCovariance::Zero();
};

/// Covariance of the pose (about `centre`) that the errors of the views' parameters cause.
/// `camera_covariance`: 11 n x 11 n, as `calibration::Calibration::joint_covariance`.
RigidCovariance camera_part(const Observation& observation, const std::vector<RegistrationView>& views,
                            const Eigen::Vector3d& centre, const Eigen::MatrixXd& camera_covariance,
                            const Part& part = {});

/// Standard deviations of an error common to the edges of a view, mm at the model.
struct EdgeSigma {
  double shift_mm;    ///< along each axis of the image
  double outward_mm;  ///< of a growth about the centre, at the model's radius
};

/// Covariance of the pose that such errors cause. `radius_mm`: of the model.
RigidCovariance edge_part(const Observation& observation, const std::vector<RegistrationView>& views,
                          const Eigen::Vector3d& centre, double radius_mm, const EdgeSigma& sigma,
                          const Part& part = {});

/// Local shifts (full-resolution pixels) that the comparisons of a view still ask for, each along its own
/// best determined direction; root mean square by weight.
double local_shift_px(const ViewObservation& view, const geometry::View& camera,
                      const Eigen::Vector3d& centre);

}  // namespace helicarm::registration
