// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/grey_window.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "helicarm/core/statistics.h"

namespace helicarm::image {

GreyWindow usual_window(const Image<float>& grey_image, float lowest) {
  // Of a large image a million values are enough.
  constexpr double enough = 1e6;
  const int step = std::max(1, static_cast<int>(std::sqrt(double(grey_image.pixels().size()) / enough)));
  std::vector<float> values;
  for (int v = 0; v < grey_image.height(); v += step)
    for (int u = 0; u < grey_image.width(); u += step)
      if (const float value = grey_image(u, v); value > lowest) values.push_back(value);
  if (values.empty()) return {lowest, lowest + 1};
  const float low = quantile(values, 0.005);
  return {low, quantile(values, 0.995)};
}

Image<std::uint8_t> eight_bit(const Image<float>& grey_image, GreyWindow window) {
  Image<std::uint8_t> grey(grey_image.width(), grey_image.height());
  const float scale = 255 / std::max(window.high - window.low, 1e-6f);
  std::ranges::transform(grey_image.pixels(), grey.pixels().begin(), [&](float value) {
    return static_cast<std::uint8_t>(std::clamp((value - window.low) * scale, 0.0f, 255.0f));
  });
  return grey;
}

}  // namespace helicarm::image
