// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/dot.h"
#include "helicarm/image/image.h"

namespace helicarm::detection {

enum class Polarity { dark, bright };
constexpr Polarity opposite(Polarity polarity) {
  return polarity == Polarity::dark ? Polarity::bright : Polarity::dark;
}

struct BlobOptions {
  Polarity polarity = Polarity::dark;
  double min_radius_px = 2;
  double max_radius_px = 40;
  double threshold_sigma = 6;  ///< multiple of the filtered image's noise
  double max_elongation = 4;   ///< ratio of principal curvatures above which a blob is a line or an edge
  std::size_t max_count = 8000;
};

/// Approximate centres and radii of round blobs: maxima over position and scale of differences of Gaussians
/// (Lowe 2004; the response to a disc of radius r peaks at sigma = r / sqrt 2). Strongest first; `contrast`
/// is the response, sigma is not set.
std::vector<Dot> find_blobs(image::Image<float> image, const BlobOptions& options);

}  // namespace helicarm::detection
