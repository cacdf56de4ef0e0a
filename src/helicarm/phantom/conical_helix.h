// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <numbers>

#include <Eigen/Core>

namespace helicarm::phantom {

/// The conical spiral of Eq. 9 with the paper's parameters. Its axis is the calibrator's z; t = 0 at the
/// base.
struct ConicalHelix {
  double rr = 60;      ///< radius at the base, mm
  double pp = 31.529;  ///< angle over which the radius falls by a factor e, rad
  double h = 3.979;    ///< rise, mm/rad
  double t_end = 7 * std::numbers::pi;

  double radius(double t) const { return rr * std::exp(-t / pp); }
  Eigen::Vector3d point(double t) const { return {radius(t) * std::cos(t), radius(t) * std::sin(t), h * t}; }
};

}  // namespace helicarm::phantom
