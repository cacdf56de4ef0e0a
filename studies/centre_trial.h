// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "studies/ball_scene.h"

namespace helicarm::study {

/// Changes of a situation to the image or to the assumptions of the fit.
struct CentreSituation {
  std::string group, name;
  double scatter = 0.3;  ///< relative to the direct signal
  double quanta = 1000;  ///< per pixel, mean over the field
  double screen_sigma_px = 0.65;
  double focus_sigma_px = 0.6;
  bool logarithmic = false;
  double diameter_mm = 4;
  Companion companion = Companion::none;
  bool places_known = false;               ///< approximate positions of the balls are given; no search
  double clipped = 0;                      ///< share of the ball's background
  double blur_factor = 1;                  ///< on the fitted blur
  std::optional<double> held_radius = {};  ///< relative to the true one; empty: fitted
};

/// Record of one image: counts and sums.
struct CentreSums {
  double balls = 0, refused = 0, covered = 0, bounds = 0;
  double squares = 0, normed = 0, variances = 0, bias = 0, radii = 0, bound_squares = 0;

  void add(const Eigen::Vector2d& error, double sigma, const Eigen::Vector2d& towards);
};

/// An image with `squares` across, one ball in each.
CentreSums try_image(const CentreSituation& situation, int squares, std::uint64_t seed, std::size_t image);

/// A calibrator before a knee on a flat panel, with a wire over a ball in each view: isolated balls, and
/// balls that other metal touches.
std::array<CentreSums, 2> try_case(std::uint64_t seed);

}  // namespace helicarm::study
