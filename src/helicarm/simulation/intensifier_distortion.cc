// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/intensifier_distortion.h"

#include <cmath>
#include <numbers>

namespace helicarm::simulation {

Eigen::Vector2d IntensifierDistortion::ideal_from_raw(const Eigen::Vector2d& raw) const {
  const Eigen::Vector2d offset = raw - centre_px;
  const double rho2 = offset.squaredNorm() / (radius_px * radius_px);
  const double scale = 1 + rho2 * (k1 + rho2 * k2);
  const double angle = s_rotation * std::sin(0.5 * std::numbers::pi * rho2);
  const double c = scale * std::cos(angle);
  const double s = scale * std::sin(angle);
  Eigen::Vector2d ideal = centre_px + shift_px;
  ideal += Eigen::Vector2d(c * offset.x() - s * offset.y(), s * offset.x() + c * offset.y());
  for (const DistortionBump& bump : bumps) {
    const double distance2 = (raw - bump.centre_px).squaredNorm() / (bump.sigma_px * bump.sigma_px);
    if (distance2 > 64) continue;  // below 1e-14 of the amplitude: saves most of the exponentials
    ideal += std::exp(-0.5 * distance2) * bump.shift_px;
  }
  return ideal;
}

Eigen::Vector2d IntensifierDistortion::raw_from_ideal(const Eigen::Vector2d& ideal) const {
  // The map is close to the identity, so Newton's Jacobian is approximated by the identity.
  Eigen::Vector2d raw = ideal;
  for (int round = 0; round < 60; ++round) {
    const Eigen::Vector2d step = ideal - ideal_from_raw(raw);
    raw += step;
    if (step.norm() < 1e-11) break;
  }
  return raw;
}

}  // namespace helicarm::simulation
