// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/usable.h"

#include <algorithm>
#include <vector>

#include <fmt/format.h>

namespace helicarm::rectification {
namespace {

constexpr double least_range = 0.01;    // of block means, relative to the grey scale
constexpr double most_saturated = 0.9;  // of the field

/// Means of 16 x 16 pixel blocks: averages noise, keeps structure.
constexpr int side = 16;  // of a block

std::vector<float> block_means(const image::Image<float>& image) {
  std::vector<float> means;
  for (int v = 0; v + side <= image.height(); v += side)
    for (int u = 0; u + side <= image.width(); u += side) {
      float sum = 0;
      for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x) sum += image(u + x, v + y);
      means.push_back(sum / (side * side));
    }
  return means;
}

}  // namespace

double saturated_share(const xray::XrayImage& xray_image) {
  const float black = xray_image.lowest + 0.002f * (xray_image.highest - xray_image.lowest);
  std::size_t field = 0;
  std::size_t clipped = 0;
  for (const float grey : xray_image.pixels.pixels()) {
    field += grey > black;
    clipped += grey >= xray_image.highest;
  }
  return field == 0 ? 0 : double(clipped) / double(field);
}

Expected<void> check_usable(const xray::XrayImage& xray_image) {
  std::vector<float> means = block_means(xray_image.pixels);
  if (means.size() < 9)
    return fail(Reason::bad_size,
                fmt::format("{} x {} pixels are too few for a calibrator, at least {} x {} are needed",
                            xray_image.pixels.width(), xray_image.pixels.height(), 3 * side, 3 * side));
  std::sort(means.begin(), means.end());
  const double share = saturated_share(xray_image);
  if (share > most_saturated && means.back() > xray_image.lowest)
    return fail(Reason::saturated,
                fmt::format("{:.0f} % of the field is clipped at the highest grey value", 100 * share),
                {{"saturated_share", share}});
  const auto at = [&](double q) {
    return double(means[static_cast<std::size_t>(q * double(means.size() - 1))]);
  };
  const double range = (at(0.99) - at(0.01)) / double(xray_image.highest - xray_image.lowest);
  if (range < least_range)
    return fail(Reason::blank_image,
                fmt::format("the image is blank: its grey values span {:.2f} % of the scale", 100 * range),
                {{"grey_range", range}});
  return {};
}

}  // namespace helicarm::rectification
