// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "helicarm/track/marker_image.h"

namespace helicarm::track {

/// A marker whose place, size and contrast are known about.
struct KnownMarker {
  Eigen::Vector2d at;          ///< raw px
  Eigen::Matrix2d covariance;  ///< of it; zero: the fit begins here, without a search
  double radius_px = 0;
  ContrastModel contrast;
};

/// Another marker near it, at a place that is known.
struct KnownNeighbour {
  Eigen::Vector2d at;  ///< raw px
  double radius_px = 0;
};

struct EvidentMarker {
  MarkerImage image;
  double evidence = 0;  ///< logarithm of the likelihood ratio: a marker here against background alone
};

/// Fits place and contrast of a marker of known radius, with its neighbours' contrasts, on a quadratic
/// background of which it hides its share; the contrast has the model's prior. Nothing where the window
/// leaves the image or the fit does not converge near the expected place. The place is by the pixels alone,
/// the evidence also by the expected place.
std::optional<EvidentMarker> fit_known_marker(const image::Image<float>& grey, const KnownMarker& marker,
                                              std::span<const KnownNeighbour> others,
                                              const MarkerAppearance& appearance);

}  // namespace helicarm::track
