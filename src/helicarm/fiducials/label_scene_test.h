// SPDX-License-Identifier: Apache-2.0
// Random synthetic images of a calibrator for the tests of labelling.
#pragma once

#include <algorithm>
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

enum class Shape { flat, symmetric, helical, coded_helix, cylinder };

/// Balls at random in a slab, in pairs (exact reflections or half turns), or on the conical helix.
inline phantom::Calibrator shaped(Shape shape, int balls, RandomStream& random) {
  phantom::Calibrator calibrator{"shaped", {}, {}};
  const Eigen::Vector3d twin =
      random.uniform() < 0.5 ? Eigen::Vector3d(-1, 1, 1) : Eigen::Vector3d(-1, -1, 1);
  for (int k = 0; k < balls; ++k) {
    Eigen::Vector3d centre(random.uniform(-53, 53), random.uniform(-35, 35), random.uniform(-4, 4));
    if (shape == Shape::symmetric && k % 2 == 0)
      centre = {random.uniform(5, 50), random.uniform(-45, 45), random.uniform(-30, 30)};
    if (shape == Shape::symmetric && k % 2 == 1)
      centre = calibrator.balls.back().centre_in_calibrator.cwiseProduct(twin);
    if (shape == Shape::helical) {
      const double t = pi / 6 + k * pi / 2;
      const double radius = 60 * std::exp(-t / 31.529);
      centre = {radius * std::cos(t), radius * std::sin(t), 87.5 * t / (7 * pi)};
    }
    calibrator.balls.push_back({fmt::format("B{}", k), centre, 4.0});
  }
  return calibrator;
}

struct ShapedView {
  Shape shape;
  phantom::Calibrator calibrator;
  LabellingPrior prior;
  double noise_px;
  SyntheticImage image;
};

/// 6 to 18 balls of which at most three are hidden, up to eight false candidates, centres with noise of 0.05
/// to 0.5 px. The handedness is known in one view of three.
inline ShapedView shaped_view(std::uint64_t seed, std::uint64_t number) {
  RandomStream random(seed, 90, number);
  const auto shape = static_cast<Shape>(number % 3);
  const int balls = 6 + static_cast<int>(random.index(13));
  ShapedView view{shape, shaped(shape, balls, random), nominal, 0.05 * std::pow(10, random.uniform()), {}};
  const int hidden = static_cast<int>(random.index(static_cast<std::uint32_t>(std::min(4, balls - 5))));
  const int outliers = static_cast<int>(random.index(9));
  view.image =
      image_of(view.calibrator, {.hidden = hidden, .outliers = outliers, .noise_px = view.noise_px}, random);
  for (BallCandidate& candidate : view.image.candidates) candidate.own_sigma_px = view.noise_px;
  if (random.index(3) == 0) view.prior.mirrored = view.image.mirrored();
  return view;
}

/// Balls of two sizes at random on a screw: 24 on two and a half turns, or 108 on the cylinder of 67 mm of
/// the published phantom, where a step along is nearly a congruence.
inline phantom::Calibrator coded(Shape shape, RandomStream& random) {
  const bool is_cylinder = shape == Shape::cylinder;
  const int balls = is_cylinder ? 108 : 24;
  const double radius_mm = is_cylinder ? 67 : 55, turn_deg = is_cylinder ? 9 : 37.5,
               step_mm = is_cylinder ? 1.308411215 : 120 / 23.0;
  phantom::Calibrator calibrator{"coded", {}, {}};
  for (int k = 0; k < balls; ++k) {
    const double t = turn_deg * k * pi / 180;
    const Eigen::Vector3d centre(radius_mm * std::cos(t), radius_mm * std::sin(t), step_mm * k);
    calibrator.balls.push_back({fmt::format("B{}", k), centre, random.index(2) == 0 ? 3.2 : 2.0});
  }
  return calibrator;
}

/// Up to a third of the balls hidden, up to eight false candidates, centres with noise of 0.05 to 0.5 px; in
/// half of the views one ball's size is read as the other. The handedness is known in one view of three.
inline ShapedView coded_view(std::uint64_t seed, std::uint64_t number) {
  RandomStream random(seed, 91, number);
  const Shape shape = number % 2 == 0 ? Shape::coded_helix : Shape::cylinder;
  ShapedView view{shape, coded(shape, random), nominal, 0.05 * std::pow(10, random.uniform()), {}};
  const auto third = static_cast<std::uint32_t>(view.calibrator.balls.size() / 3);
  const int hidden = static_cast<int>(random.index(third + 1)), outliers = static_cast<int>(random.index(9));
  view.image =
      image_of(view.calibrator, {.hidden = hidden, .outliers = outliers, .noise_px = view.noise_px}, random);
  for (BallCandidate& candidate : view.image.candidates) candidate.own_sigma_px = view.noise_px;
  if (random.index(3) == 0) view.prior.mirrored = view.image.mirrored();
  if (random.index(2) == 0) {
    const std::size_t i = random.index(static_cast<std::uint32_t>(view.image.detections.size()));
    if (simulation::SyntheticDetection& seen = view.image.detections[i]; seen.ball >= 0) {
      const bool is_large = view.calibrator.balls[std::size_t(seen.ball)].diameter_mm > 3;
      seen.radius_px *= is_large ? 2.0 / 3.2 : 3.2 / 2.0;
      seen.ball = -1;
      view.image.candidates[i].radius_px = seen.radius_px;
    }
  }
  return view;
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
