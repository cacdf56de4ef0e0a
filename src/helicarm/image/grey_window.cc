// SPDX-License-Identifier: Apache-2.0
#include "helicarm/image/grey_window.h"

#include <algorithm>
#include <vector>

namespace helicarm::image {

GreyWindow usual_window(const Image<float>& grey_image, float lowest) {
  std::vector<float> values;
  for (float value : grey_image.pixels())
    if (value > lowest) values.push_back(value);
  if (values.empty()) return {lowest, lowest + 1};
  const auto at_share = [&](double share) {
    const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * double(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
  };
  const float low = at_share(0.005);
  return {low, at_share(0.995)};
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
