// SPDX-License-Identifier: Apache-2.0
// Random pictures of a calibrator for the labelling's tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/random.h"
#include "helicarm/fiducials/label.h"

namespace helicarm::label_scene {

inline constexpr double pi = std::numbers::pi;

/// Twelve balls on the conical helix of Eq. 9, from t0 in steps of a quarter turn.
inline Calibrator helix(double t0 = pi / 6, double height_mm = 87.5, double radius_mm = 60) {
  Calibrator calibrator{"helix", {}, {}};
  for (int k = 0; k < 12; ++k) {
    const double t = t0 + k * pi / 2;
    const double r = radius_mm * std::exp(-t / 31.529);
    calibrator.balls.push_back(
        {fmt::format("P{}", k + 1), {r * std::cos(t), r * std::sin(t), height_mm * t / (7 * pi)}, 4.0});
  }
  return calibrator;
}

inline Calibrator scattered(int balls, std::uint64_t seed) {
  RandomStream random(seed, 7);
  Calibrator calibrator{"scattered", {}, {}};
  for (int k = 0; k < balls; ++k) {
    const Eigen::Vector3d centre(random.uniform(-45, 45), random.uniform(-45, 45), random.uniform(-35, 35));
    calibrator.balls.push_back({fmt::format("B{}", k), centre, k % 2 == 0 ? 4.0 : 3.0});
  }
  return calibrator;
}

struct Difficulty {
  int hidden = 0;
  int false_blobs = 0;
  double noise_px = 0.5;
  std::optional<bool> mirrored = {};
};

struct Picture {
  std::vector<BallCandidate> candidates;
  std::vector<int> ball_of_candidate;  ///< -1: false
  std::vector<Eigen::Vector2d> exact;  ///< by ball
  int visible = 0;
  bool mirrored = false;
  double radius_bias = 0;
  double axis_deg = 0;  ///< between the ray and the calibrator's z
};

inline const LabellingPrior nominal{.focal_px = 4345, .principal_px = {511.5, 511.5}, .field_radius_px = 504};

/// A ball or a false blob as a detector finds it: radii with 2 % noise and a common bias.
inline void add(Picture& picture, RandomStream& random, const Eigen::Vector2d& uv, double radius, int ball) {
  picture.candidates.push_back({uv, 0, radius * (1 + 0.02 * random.normal()), 0.02 * radius});
  picture.ball_of_candidate.push_back(ball);
}

inline Picture random_picture(const Calibrator& calibrator, const Difficulty& difficulty,
                              RandomStream& random) {
  Picture picture;
  View view;
  picture.mirrored = difficulty.mirrored.value_or(random.uniform() < 0.5);
  const double f = 4345 * random.uniform(0.99, 1.01);
  const double off = 55 * std::sqrt(random.uniform());
  const double way = random.uniform(0, 2 * pi);
  view.intrinsics = {picture.mirrored ? -f : f, f, 511.5 + off * std::cos(way), 511.5 + off * std::sin(way)};
  view.camera_from_world.rotation =
      Eigen::Quaterniond(random.normal(), random.normal(), random.normal(), random.normal())
          .normalized()
          .matrix();
  picture.axis_deg = std::acos(std::abs(view.camera_from_world.rotation(2, 2))) * 180 / pi;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const auto& ball : calibrator.balls) centre += ball.centre_in_calibrator / calibrator.balls.size();
  const Eigen::Vector3d place(random.uniform(-20, 20), random.uniform(-20, 20), random.uniform(550, 800));
  view.camera_from_world.translation = place - view.camera_from_world.rotation * centre;
  const double bias = random.uniform(0.98, 1.02);
  picture.radius_bias = bias - 1;

  std::vector<int> order(calibrator.balls.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  for (std::size_t i = order.size(); i > 1; --i)
    std::swap(order[i - 1], order[random.index(static_cast<std::uint32_t>(i))]);
  picture.exact.resize(order.size());
  std::vector<bool> shown(order.size(), false);
  for (std::size_t i = 0; i < order.size(); ++i) {
    const int k = order[i];
    picture.exact[k] = view.project(calibrator.balls[k].centre_in_calibrator);
    shown[k] = i >= static_cast<std::size_t>(difficulty.hidden) &&
               (picture.exact[k] - nominal.principal_px).norm() < nominal.field_radius_px;
  }
  const auto disc = [&](int k) {
    return bias * f * calibrator.balls[k].diameter_mm / 2 /
           view.depth(calibrator.balls[k].centre_in_calibrator);
  };
  for (const int k : order) {
    if (!shown[k]) continue;
    const Eigen::Vector2d noisy =
        picture.exact[k] + difficulty.noise_px * Eigen::Vector2d(random.normal(), random.normal());
    const auto merged = std::find_if(order.begin(), order.end(), [&](int other) {
      return other != k && shown[other] && (picture.exact[other] - picture.exact[k]).norm() < 0.7 * disc(k);
    });
    if (merged == order.end()) {
      add(picture, random, noisy, disc(k), k);
      ++picture.visible;
    } else if (*merged > k) {
      add(picture, random, (noisy + picture.exact[*merged]) / 2, disc(k), -1);
    }
  }
  for (int i = 0; i < difficulty.false_blobs; ++i) {
    const double reach = i % 2 == 0 ? 504 : 300;  // half of them among the balls
    const double rho = reach * std::sqrt(random.uniform());
    const double phi = random.uniform(0, 2 * pi);
    const Eigen::Vector2d uv = nominal.principal_px + rho * Eigen::Vector2d(std::cos(phi), std::sin(phi));
    const bool free = std::all_of(picture.candidates.begin(), picture.candidates.end(),
                                  [&](const BallCandidate& other) { return (other.uv - uv).norm() > 10; });
    if (free) add(picture, random, uv, disc(order[0]), -1);
  }
  for (auto& candidate : picture.candidates) candidate.sigma_px = difficulty.noise_px;
  return picture;
}

}  // namespace helicarm::label_scene
