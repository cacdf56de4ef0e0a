// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/detection/blobs.h"
#include "helicarm/detection/dot.h"
#include "helicarm/detection/noise.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::detection {

/// The round dots of one image (2.1), each searched for once: the plate's and the fiducials' are chosen from
/// them.
struct ImageDots {
  double from_px = 2;                            ///< smallest radius that is searched for
  std::optional<std::vector<Dot>> dark, bright;  ///< raw pixels; nothing: not searched for
  NoiseCorrelation noise;                        ///< of the image
};

/// Of an image whose dots have not been searched for.
ImageDots unsearched(const xray::XrayImage& xray_image, double from_px);

/// The dots of one polarity up to the largest ball; searches for them if that has not been done.
const std::vector<Dot>& dots_of(ImageDots& dots, const xray::XrayImage& xray_image, Polarity polarity);

/// The dots that a search from a larger radius finds.
std::vector<Dot> from_radius(const std::vector<Dot>& dots, double from_px);

}  // namespace helicarm::detection
