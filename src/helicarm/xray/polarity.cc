// SPDX-License-Identifier: Apache-2.0
#include "helicarm/xray/polarity.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "helicarm/core/statistics.h"

namespace helicarm::xray {
namespace {

constexpr int samples_across = 256;
constexpr std::size_t enough = 20;   // least number of extreme samples
constexpr std::size_t majority = 4;  // least ratio to the number of samples of the other polarity

}  // namespace

std::optional<bool> metal_looks_bright(const image::Image<float>& image) {
  const int side = std::min(image.width(), image.height());
  const int ring = std::max(3, side / 64);
  const int step = std::max(1, side / samples_across);
  const int slant = (ring * 7 + 5) / 10;
  const std::array<std::pair<int, int>, 8> around = {{{ring, 0},
                                                      {slant, slant},
                                                      {0, ring},
                                                      {-slant, slant},
                                                      {-ring, 0},
                                                      {-slant, -slant},
                                                      {0, -ring},
                                                      {slant, -slant}}};
  std::vector<float> above, below, noise;
  for (int v = ring; v < image.height() - ring; v += step)
    for (int u = ring; u < image.width() - ring; u += step) {
      float low = image(u + ring, v), high = low;
      for (const auto& [du, dv] : around) {
        low = std::min(low, image(u + du, v + dv));
        high = std::max(high, image(u + du, v + dv));
      }
      const float value = image(u, v);
      noise.push_back(high - low);
      if (value > high) above.push_back(value - high);
      if (value < low) below.push_back(low - value);
    }
  if (noise.empty()) return std::nullopt;
  const float typical = median(std::move(noise));
  const auto stand_out = [&](const std::vector<float>& excess) {
    return static_cast<std::size_t>(std::ranges::count_if(excess, [&](float e) { return e > 2 * typical; }));
  };
  const std::size_t bright = stand_out(above), dark = stand_out(below);
  if (std::max(bright, dark) < enough) return std::nullopt;
  if (bright >= majority * dark) return true;
  if (dark >= majority * bright) return false;
  return std::nullopt;
}

}  // namespace helicarm::xray
