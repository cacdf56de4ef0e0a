// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include "helicarm/localization/error_bound.h"
#include "helicarm/registration/register_model.h"

namespace helicarm::registration {

using Eigen::Vector3d;

Eigen::Matrix3d point_covariance(const Registration& registration, const Vector3d& in_world) {
  const auto at = [&](const RigidCovariance& covariance) {
    return point_covariance(covariance, registration.centre, in_world);
  };
  const RigidStep& step = registration.by_scale;
  const Vector3d arm = in_world - registration.centre;
  // A body that is larger lies elsewhere, and its points farther out.
  const Vector3d error = step.tail<3>() + step.head<3>().cross(arm) - registration.scale_sigma * arm;
  return at(registration.covariance - step * step.transpose()) + error * error.transpose();
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
