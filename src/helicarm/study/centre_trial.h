// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "helicarm/study/ball_scene.h"

namespace helicarm {

/// What a situation changes in the image or in what the fit is told.
struct CentreSituation {
  std::string group, name;
  double scatter = 0.3;  ///< over the direct signal
  double quanta = 1000;  ///< per pixel, mean over the field
  double screen_sigma_px = 0.65;
  double focus_sigma_px = 0.6;
  bool logarithmic = false;
  double diameter_mm = 4;
  Companion companion = Companion::none;
  bool places_known = false;               ///< of the balls, roughly: nothing is searched for
  double clipped = 0;                      ///< share of the ball's background
  double blur_factor = 1;                  ///< on the blur that the fit has found
  std::optional<double> held_radius = {};  ///< over the true one; empty: fitted
};

/// What one image adds: counts and sums, a record.
struct CentreSums {
  double balls = 0, refused = 0, covered = 0, bounds = 0;
  double squares = 0, normed = 0, variances = 0, bias = 0, radii = 0, bound_squares = 0;

  void add(const Eigen::Vector2d& error, double sigma, const Eigen::Vector2d& towards);
};

/// An image with `squares` across, a ball in each.
CentreSums try_image(const CentreSituation& situation, int squares, std::uint64_t seed, std::size_t image);

/// A calibrator before a knee on a flat panel, a wire over a ball in each view: the balls that nothing
/// touches, and those that other metal does.
std::array<CentreSums, 2> try_case(std::uint64_t seed);

}  // namespace helicarm
