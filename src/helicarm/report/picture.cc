// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/picture.h"

#include <algorithm>
#include <cmath>

namespace helicarm {

Image<std::uint8_t> rectified_picture(const ViewResult& view) {
  const bool as_stored = !view.rectification || view.rectification->map.is_identity();
  const Image<float> picture =
      as_stored ? view.exposure->pixels : resample(*view.exposure, view.rectification->map);
  // The bare rim of the field would claim the window's ends: only what differs from it sets the window.
  std::vector<float> values;
  for (float value : picture.pixels())
    if (value > view.exposure->lowest) values.push_back(value);
  Image<std::uint8_t> windowed(picture.width(), picture.height());
  if (values.empty()) return windowed;
  const auto at_share = [&](double share) {
    const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * double(values.size() - 1));
    std::nth_element(values.begin(), nth, values.end());
    return *nth;
  };
  const float low = at_share(0.005);
  const float scale = 255 / std::max(at_share(0.995) - low, 1e-6f);
  std::ranges::transform(picture.pixels(), windowed.pixels().begin(), [&](float value) {
    return static_cast<std::uint8_t>(std::clamp((value - low) * scale, 0.0f, 255.0f));
  });
  return windowed;
}

double round_below(double limit) {
  const double decade = std::pow(10, std::floor(std::log10(limit)));
  for (double factor : {5.0, 2.0})
    if (factor * decade <= limit) return factor * decade;
  return decade;
}

}  // namespace helicarm
