// SPDX-License-Identifier: Apache-2.0
// Random synthetic images of a calibrator for the tests of labelling.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/random.h"
#include "helicarm/fiducials/label.h"
#include "helicarm/simulation/synthetic_detections.h"

namespace helicarm::fiducials::label_scene {

inline constexpr double pi = std::numbers::pi;

/// Twelve balls on the conical helix of Eq. 9, from t0 in steps of a quarter turn.
inline phantom::Calibrator helix(double t0 = pi / 6, double height_mm = 87.5, double radius_mm = 60) {
  phantom::Calibrator calibrator{"helix", {}, {}};
  for (int k = 0; k < 12; ++k) {
    const double t = t0 + k * pi / 2;
    const double r = radius_mm * std::exp(-t / 31.529);
    calibrator.balls.push_back(
        {fmt::format("P{}", k + 1), {r * std::cos(t), r * std::sin(t), height_mm * t / (7 * pi)}, 4.0});
  }
  return calibrator;
}

inline phantom::Calibrator scattered(int balls, std::uint64_t seed) {
  RandomStream random(seed, 7);
  phantom::Calibrator calibrator{"scattered", {}, {}};
  for (int k = 0; k < balls; ++k) {
    const Eigen::Vector3d centre(random.uniform(-45, 45), random.uniform(-45, 45), random.uniform(-35, 35));
    calibrator.balls.push_back({fmt::format("B{}", k), centre, k % 2 == 0 ? 4.0 : 3.0});
  }
  return calibrator;
}

inline const LabellingPrior nominal{.focal_px = 4345, .principal_px = {511.5, 511.5}, .field_radius_px = 504};

struct SyntheticImage : simulation::SyntheticView {
  std::vector<BallCandidate> candidates;

  double axis_deg() const {  ///< between the central ray and the calibrator's z
    return std::acos(std::abs(view.camera_from_world.rotation(2, 2))) * 180 / pi;
  }
};

inline SyntheticImage image_of(const phantom::Calibrator& calibrator,
                               const simulation::SyntheticDetectionOptions& options, RandomStream& random) {
  SyntheticImage view_image{simulation::synthetic_detections(calibrator, options, random), {}};
  for (const auto& detection : view_image.detections)
    view_image.candidates.push_back(
        {detection.uv, detection.sigma_px, detection.radius_px, detection.radius_sigma_px});
  return view_image;
}

/// Whether the mirroring is right and each labelled ball's candidate is its detection, or lies at its image.
inline bool right(const Labelling& labelling, const SyntheticImage& view_image,
                  const phantom::Calibrator& calibrator) {
  bool all = labelling.mirrored == view_image.mirrored();
  for (std::size_t k = 0; k < calibrator.balls.size(); ++k) {
    const int i = labelling.candidate_of_ball[k];
    if (i < 0 || view_image.detections[i].ball == static_cast<int>(k)) continue;
    const Eigen::Vector2d exact = view_image.view.project(calibrator.balls[k].centre_in_calibrator);
    all &=
        (view_image.detections[i].uv - exact).norm() < 4 * std::hypot(view_image.detections[i].sigma_px, 0.2);
  }
  return all;
}

}  // namespace helicarm::fiducials::label_scene
