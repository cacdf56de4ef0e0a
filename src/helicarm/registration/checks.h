// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/registration/covariance.h"
#include "helicarm/registration/register_model.h"

namespace helicarm::registration {

/// A view's own solution: the step from the joint one about the centre, and its covariance.
struct OwnSolution {
  RigidStep step;
  RigidCovariance covariance;
  RigidStep by_scale = RigidStep::Zero();  ///< per standard deviation of the model's size
  /// What the stated bias of the model's edges (`EdgeSigma`) has in the covariance.
  RigidCovariance by_edges = RigidCovariance::Zero();

  /// As if that bias had `ratio` of its stated variance.
  OwnSolution with_edges(double ratio) const;
};

/// Differences between each view's own solution and the others' weighted mean; in mm along the direction
/// across both viewing directions, which both views see without depth. The model's size, which the views have
/// in common, is estimated with them.
Disagreement disagreement_of(const std::vector<RegistrationView>& views, const Eigen::Vector3d& centre,
                             const std::vector<OwnSolution>& own);

/// The strain that would lower the residuals most, from one Gauss-Newton step of pose and strain under a
/// prior of 5 %; of a single view only across its ray, along which it sees almost no size. Its sigma holds
/// what the cameras and the model's edges allow.
Deformation deformation_of(const Observation& observation, const ErrorModel& errors,
                           const Eigen::Vector3d& centre);

/// Variance of the bias common to a view's edges, in units of the stated one (`EdgeSigma`): its mean given
/// the strains that the images require and how far the views' own solutions are apart, both of which such a
/// bias causes as it causes errors of the pose. Beforehand each size from 0.01 to 4 times the stated one is
/// as likely as another. Needs two or more views.
double edge_variance_ratio(const Observation& observation, const ErrorModel& errors,
                           const Eigen::Vector3d& centre, const std::vector<OwnSolution>& own);

/// Sets decision, failure, warnings and notes from the figures.
void decide(const Model& model, const std::vector<geometry::RigidTransform>& starts,
            const RegistrationOptions& options, Registration& result);

/// Whether the search of a refused registration may have missed the solution.
bool may_have_missed(const Registration& result);

/// Whether a registration counts that follows one which missed the solution: of its starts two, and one in
/// 128, or more end at the pose, or the volume explains each view clearly better than required. Else it may
/// be chance: so many poses were searched.
bool is_confirmed(const Model& model, const Registration& result);

}  // namespace helicarm::registration
