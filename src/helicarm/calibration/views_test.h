// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <numbers>
#include <string>

#include <fmt/format.h>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/core/random_vectors.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::calibration {

/// The views of 2.3.3: f = 900 mm, pixel 0.15 mm, calibrator's middle 800 mm from the source.
inline geometry::View paper_view(double alpha) {
  const Eigen::Matrix3d rotation = geometry::rotation_from_euler(alpha, 0, 0);
  return {{6000, 6000, 512, 512, 0},
          {rotation, Eigen::Vector3d(0, 0, 800) - rotation * Eigen::Vector3d(0, 0, 40)}};
}

/// The first n of twelve balls on the helix, with normal noise.
inline ViewFiducials observed_fiducials(const std::string& name, const geometry::View& view, double sigma,
                                        RandomStream& random, int n = 12) {
  ViewFiducials result{name, {}};
  for (int k = 0; k < n; ++k) {
    const double t = std::numbers::pi / 6 + k * std::numbers::pi / 2;
    const double radius = 60 * std::exp(-t / 31.529);
    fiducials::Fiducial f{fmt::format("P{}", k + 1), {radius * std::cos(t), radius * std::sin(t), 3.979 * t}};
    f.status = fiducials::FiducialStatus::used;
    f.sigma_px = sigma;
    f.uv = view.project(f.centre_in_calibrator) + sigma * normal_2(random);
    result.fiducials.push_back(f);
  }
  return result;
}

}  // namespace helicarm::calibration
