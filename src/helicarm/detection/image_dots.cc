// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/image_dots.h"

#include <algorithm>
#include <iterator>

#include "helicarm/detection/find_dots.h"

namespace helicarm::detection {

ImageDots unsearched(const xray::XrayImage& xray_image, double from_px) {
  return {from_px, {}, {}, noise_correlation(xray_image)};
}

const std::vector<Dot>& dots_of(ImageDots& dots, const xray::XrayImage& xray_image, Polarity polarity) {
  constexpr double largest_ball = 0.04;  // radius relative to the image's width
  auto& found = polarity == Polarity::dark ? dots.dark : dots.bright;
  if (!found) {
    DotOptions search;
    search.polarity = polarity;
    search.min_radius_px = dots.from_px;
    search.max_radius_px = std::max(16.0, largest_ball * xray_image.pixels.width());
    found = find_dots(xray_image, search);
  }
  return *found;
}

std::vector<Dot> from_radius(const std::vector<Dot>& dots, double from_px) {
  std::vector<Dot> large;
  std::ranges::copy_if(dots, std::back_inserter(large),
                       [&](const Dot& dot) { return dot.radius_px >= fit_reach * from_px; });
  return large;
}

}  // namespace helicarm::detection
