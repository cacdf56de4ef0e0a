// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/raster.h"

#include <algorithm>
#include <cmath>

namespace helicarm::registration {
namespace {

using image::Image;

constexpr float black = 0.01F;       // of the grey range: outside the field
constexpr float least_dose = 0.02F;  // of the grey range: added before the logarithm, against noise in metal
constexpr double margin = 1.0 / 64;  // of the image's width: the field's edge is blurred

/// Marks what is black and joined to the image's border.
Image<std::uint8_t> surround_of(const RegistrationView& view) {
  const Image<float>& grey = view.grey;
  const float limit = view.lowest + black * (view.highest - view.lowest);
  Image<std::uint8_t> outside(grey.width(), grey.height(), 0);
  std::vector<std::pair<int, int>> open;
  const auto visit = [&](int u, int v) {
    if (!grey.contains(u, v) || outside(u, v) || grey(u, v) > limit) return;
    outside(u, v) = 1;
    open.emplace_back(u, v);
  };
  for (int u = 0; u < grey.width(); ++u) visit(u, 0), visit(u, grey.height() - 1);
  for (int v = 0; v < grey.height(); ++v) visit(0, v), visit(grey.width() - 1, v);
  while (!open.empty()) {
    const auto [u, v] = open.back();
    open.pop_back();
    visit(u - 1, v), visit(u + 1, v), visit(u, v - 1), visit(u, v + 1);
  }
  return outside;
}

/// Clears `valid` within `reach` of marked pixels (a square), one axis after the other.
void exclude_around(const Image<std::uint8_t>& marked, int reach, Image<std::uint8_t>& valid) {
  Image<std::uint8_t> wide(marked.width(), marked.height(), 0);
  for (int v = 0; v < marked.height(); ++v) {
    int last = -1000000;
    for (int u = 0; u < marked.width(); ++u) {
      if (marked(u, v)) last = u;
      if (u - last <= reach) wide(u, v) = 1;
    }
    last = 1000000;
    for (int u = marked.width() - 1; u >= 0; --u) {
      if (marked(u, v)) last = u;
      if (last - u <= reach) wide(u, v) = 1;
    }
  }
  for (int u = 0; u < marked.width(); ++u) {
    int last = -1000000;
    for (int v = 0; v < marked.height(); ++v) {
      if (wide(u, v)) last = v;
      if (v - last <= reach) valid(u, v) = 0;
    }
    last = 1000000;
    for (int v = marked.height() - 1; v >= 0; --v) {
      if (wide(u, v)) last = v;
      if (last - v <= reach) valid(u, v) = 0;
    }
  }
}

}  // namespace

Raster attenuation_raster(const RegistrationView& view) {
  const Image<float>& grey = view.grey;
  Raster raster{1, Image<float>(grey.width(), grey.height()),
                view.usable.empty() ? Image<std::uint8_t>(grey.width(), grey.height(), 1) : view.usable};
  const float range = view.highest - view.lowest;
  for (int v = 0; v < grey.height(); ++v)
    for (int u = 0; u < grey.width(); ++u) {
      const float dose = std::max(0.0F, (grey(u, v) - view.lowest) / range);
      raster.attenuation(u, v) = view.logarithmic ? -dose : -std::log(dose + least_dose);
    }
  exclude_around(surround_of(view), static_cast<int>(std::ceil(margin * grey.width())), raster.valid);
  return raster;
}

Raster coarser(const Raster& full, int factor) {
  if (factor == 1) return full;
  const int width = full.attenuation.width() / factor, height = full.attenuation.height() / factor;
  Raster coarse{factor, Image<float>(width, height), Image<std::uint8_t>(width, height, 1)};
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      float sum = 0;
      int valid = 0;
      for (int j = 0; j < factor; ++j)
        for (int i = 0; i < factor; ++i) {
          if (!full.valid(u * factor + i, v * factor + j)) continue;
          sum += full.attenuation(u * factor + i, v * factor + j);
          ++valid;
        }
      coarse.attenuation(u, v) = sum / static_cast<float>(std::max(1, valid));
      coarse.valid(u, v) = 2 * valid > factor * factor;
    }
  return coarse;
}

}  // namespace helicarm::registration
