// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include <Eigen/Core>

namespace helicarm::calibration {

/// Direction of the central ray at these positioner angles; nothing where the image does not state them.
inline std::optional<Eigen::Vector3d> c_arm_direction(std::optional<double> primary_deg,
                                                      std::optional<double> secondary_deg) {
  if (!primary_deg) return {};
  constexpr double radian = std::numbers::pi / 180;
  const double primary = *primary_deg * radian, secondary = secondary_deg.value_or(0) * radian;
  return Eigen::Vector3d(std::sin(primary) * std::cos(secondary), std::sin(secondary),
                         std::cos(primary) * std::cos(secondary));
}

/// Of what depends smoothly on the position, in two of them; 0 where one is not known.
inline double position_correlation(const std::optional<Eigen::Vector3d>& a,
                                   const std::optional<Eigen::Vector3d>& b) {
  constexpr double correlated_deg = 40;
  if (!a || !b) return 0;
  const double apart_deg = std::acos(std::clamp(a->dot(*b), -1.0, 1.0)) * 180 / std::numbers::pi;
  return std::exp(-0.5 * std::pow(apart_deg / correlated_deg, 2));
}

}  // namespace helicarm::calibration
