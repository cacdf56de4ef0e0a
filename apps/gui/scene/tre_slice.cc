// SPDX-License-Identifier: Apache-2.0
#include "gui/scene/tre_slice.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "helicarm/report/axis.h"

namespace helicarm::gui {

TreSlice slice_of(const localization::TreVolume& volume, SliceAxis axis, double place_mm) {
  const int across = int(axis), side = volume.side;
  const double layer = std::clamp((place_mm - volume.first[across]) / volume.step_mm, 0.0, double(side - 1));
  const int below = std::min(int(layer), std::max(0, side - 2));
  const double share = layer - below;
  TreSlice slice{side, {}, {}};
  for (int row = 0; row < side; ++row)
    for (int column = 0; column < side; ++column) {
      Eigen::Vector3i at;
      at[across] = below;
      at[(across + 1) % 3] = column;
      at[(across + 2) % 3] = row;
      Eigen::Vector3d place = volume.place(at.x(), at.y(), at.z());
      place[across] = volume.first[across] + layer * volume.step_mm;
      double value = volume.at(at.x(), at.y(), at.z());
      if (share > 0) {
        ++at[across];
        value = (1 - share) * value + share * volume.at(at.x(), at.y(), at.z());
      }
      slice.places.push_back(place);
      slice.rms_mm.push_back(value);
    }
  return slice;
}

TreScale scale_of(const localization::TreVolume& volume) {
  constexpr int marks = 5;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double value : volume.rms_mm)
    if (std::isfinite(value)) low = std::min(low, value), high = std::max(high, value);
  if (!(high > low)) return high == low ? TreScale{low - 0.5, low + 0.5, 0.5} : TreScale{0, 1, 0.5};
  const double step = report::round_step(high - low, marks);
  return {std::floor(low / step) * step, std::ceil(high / step) * step, step};
}

Colour colour_of(double share) {
  // CIELAB: lightness 24 to 90, hue 305 to 100 degrees, maximum chroma within sRGB.
  static constexpr std::array<Colour, 11> colours{{{59, 40, 132},
                                                   {0, 70, 145},
                                                   {3, 92, 142},
                                                   {0, 112, 147},
                                                   {0, 132, 154},
                                                   {7, 152, 158},
                                                   {6, 173, 155},
                                                   {3, 195, 136},
                                                   {106, 212, 109},
                                                   {177, 223, 91},
                                                   {243, 230, 86}}};
  const double at = std::clamp(share, 0.0, 1.0) * (colours.size() - 1);
  const auto below = std::min<std::size_t>(std::size_t(at), colours.size() - 2);
  const double t = at - double(below);
  Colour mixed{};
  for (std::size_t c = 0; c < 3; ++c)
    mixed[c] = std::uint8_t(std::lround((1 - t) * colours[below][c] + t * colours[below + 1][c]));
  return mixed;
}

}  // namespace helicarm::gui
