// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/detection/ball_profile.h"
#include "helicarm/detection/dot.h"
#include "helicarm/detection/noise.h"
#include "helicarm/image/image.h"

namespace helicarm::detection {

/// A disc of pixels that a fit ignores, raw pixels.
struct Disc {
  Eigen::Vector2d centre;
  double radius;
};

struct DotFitOptions {
  double hidden_share = 0.4;  ///< expected share of the background's slope that the dot hides
  double hidden_sigma = 0.2;  ///< and its standard deviation
  bool free_radius = true;    ///< off: the start's radius is kept
  double margin_px = 2.5;     ///< ring of background around the dot
  double margin_share = 0.1;  ///< and relative to the radius
  double tolerance = 0.03;    ///< model error of the profile relative to the contrast
  double rough = 0.3;         ///< and of the start: the outlier threshold decreases from it gradually
  int iterations = 12;
  float floor = -1e30f;      ///< pixels at or below are outside the field: ignored
  float ceiling = 1e30f;     ///< pixels at or above are saturated: the model may exceed them freely
  NoiseCorrelation noise{};  ///< for the sigma: white by default
};

/// Fits the image of a ball on a quadratic background to the pixels around `start` by robust least squares
/// over centre, radius, contrast and background: grey = B - (A + hidden G) profile, with B quadratic and G
/// its linear part. The hidden share (a ball hides neither scatter nor glare) has a prior and is estimated.
/// Nothing if the patch is not usable (outside the image, clipped, no contrast) or the fit does not converge.
std::optional<Dot> fit_dot(const image::Image<float>& image, const Dot& start, const BallProfile& profile,
                           std::span<const Disc> others, const DotFitOptions& options);

constexpr std::size_t max_dots_together = 4;

/// Like `fit_dot` for several overlapping dots. The overlap term of each pair is estimated: 0 in a
/// logarithmic image, the product of both absorptions in a linear one.
std::optional<std::vector<Dot>> fit_dots_together(const image::Image<float>& image,
                                                  std::span<const Dot> starts,
                                                  std::span<const BallProfile> profiles,
                                                  std::span<const Disc> others, const DotFitOptions& options);

}  // namespace helicarm::detection
