// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include "helicarm/localization/error_bound.h"
#include "helicarm/registration/register_model.h"

namespace helicarm::registration {

using Eigen::Vector3d;

Eigen::Matrix3d point_covariance(const RigidCovariance& covariance, const RigidStep& by_scale,
                                 double scale_sigma, const Vector3d& centre, const Vector3d& in_world) {
  const Vector3d arm = in_world - centre;
  // A body that is larger lies elsewhere, and its points farther out.
  const Vector3d error = by_scale.tail<3>() + by_scale.head<3>().cross(arm) - scale_sigma * arm;
  return point_covariance(RigidCovariance(covariance - by_scale * by_scale.transpose()), centre, in_world) +
         error * error.transpose();
}

Eigen::Matrix3d point_covariance(const Registration& registration, const Vector3d& in_world) {
  return point_covariance(registration.covariance, registration.by_scale, registration.scale_sigma,
                          registration.centre, in_world);
}

double worst_error_mm(const Model& model, const Registration& registration) {
  double worst = 0;
  for (const Vector3d& sample : model.samples) {
    const double error =
        localization::length_at_95(point_covariance(registration, registration.world_from_model * sample));
    if (std::isnan(error)) return std::numeric_limits<double>::infinity();  // over any limit
    worst = std::max(worst, error);
  }
  return worst;
}

}  // namespace helicarm::registration
