// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "helicarm/core/random.h"
#include "helicarm/geometry/rotation.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom_calibration/bundle.h"
#include "helicarm/phantom_calibration/phantom_view.h"

namespace helicarm::phantom_calibration {

inline std::vector<Eigen::Vector3d> helix_centres() {
  std::vector<Eigen::Vector3d> centres;
  for (const phantom::CalibratorBall& ball : phantom::udcsc().balls)
    centres.push_back(ball.centre_in_calibrator);
  return centres;
}

/// Views of a C-arm (f 1000 mm, 0.23 mm pixels) that differ by 20 degrees, turn about two axes, and vary in
/// their intrinsics as `synthetic_c_arm` says.
inline const calibration::CArmPrior synthetic_c_arm{calibration::IntrinsicsVariation{10, 1.4},
                                                    calibration::IntrinsicsVariation{7, 4.2}};

inline geometry::View synthetic_view(int number, RandomStream& random) {
  constexpr double degree = std::numbers::pi / 180, unit = 1 / 0.23;
  const double across = 20 * degree * (number % 2 == 0 ? number : -number) / 2;
  const Eigen::Matrix3d rotation = geometry::rotation_from_vector({0, across, 0}) *
                                   geometry::rotation_from_vector({1.9 + 8 * degree * number, 0, 0.1});
  const double focal = (1000 + 4 + 1.4 * random.normal()) * unit;
  return {{focal, focal, 511.5 + unit * (2 + 4.2 * random.normal()), 511.5 + unit * 4.2 * random.normal(), 0},
          {rotation, Eigen::Vector3d(5, -3, 750) - rotation * Eigen::Vector3d(0, 0, 35)}};
}

/// Images of all centres with normal noise; starts are a little off.
inline BundleProblem synthetic_problem(const std::vector<Eigen::Vector3d>& truth, int views, double sigma_px,
                                       std::uint64_t seed) {
  RandomStream random(seed, 1, 0);
  const auto noise = [&](double sigma) {
    return Eigen::Vector3d(sigma * random.normal(), sigma * random.normal(), sigma * random.normal());
  };
  BundleProblem problem;
  problem.c_arm = synthetic_c_arm;
  for (const Eigen::Vector3d& centre : truth) problem.centres.push_back(centre + noise(0.5));
  for (int v = 0; v < views; ++v) {
    BundleView view;
    view.name = std::string(1, char('A' + v));
    const geometry::View exact = synthetic_view(v, random);
    view.start = exact;
    view.start.camera_from_world.rotation =
        geometry::rotation_from_vector(noise(0.01)) * exact.camera_from_world.rotation;
    view.start.camera_from_world.translation += noise(2);
    view.prior.unit_px = 1 / 0.23;
    view.prior.focal_px = 1000 * view.prior.unit_px;
    view.prior.principal_px = Eigen::Vector2d(511.5, 511.5);
    view.prior.aspect = geometry::NormalPrior{1, 0.001};
    for (std::size_t i = 0; i < truth.size(); ++i)
      view.images.push_back({i, exact.project(truth[i]) + noise(sigma_px).head<2>(), sigma_px});
    problem.views.push_back(std::move(view));
  }
  return problem;
}

}  // namespace helicarm::phantom_calibration
