// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/tre_figure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "helicarm/report/axis.h"
#include "helicarm/report/isoline.h"

namespace helicarm::report {
namespace {

constexpr double slice_px = 380, left_px = 60, top_px = 40, gap_px = 80;

/// Equal steps of the viridis colour map, dark to light.
constexpr std::array<std::array<int, 3>, 6> colours{
    {{68, 1, 84}, {65, 68, 135}, {42, 120, 142}, {34, 168, 132}, {122, 209, 81}, {253, 231, 37}}};

std::string colour_of(double share) {
  const double at = std::clamp(share, 0.0, 1.0) * (colours.size() - 1);
  const auto below = std::min<std::size_t>(std::size_t(at), colours.size() - 2);
  const double t = at - double(below);
  std::array<int, 3> mixed{};
  for (std::size_t c = 0; c < 3; ++c)
    mixed[c] = int(std::lround((1 - t) * colours[below][c] + t * colours[below + 1][c]));
  return fmt::format("#{:02x}{:02x}{:02x}", mixed[0], mixed[1], mixed[2]);
}

struct Scale {
  double low, high, step;
  double share(double value) const { return (value - low) / (high - low); }
};

/// Range over the two displayed slices.
Scale scale_of(const localization::TreVolume& volume) {
  double low = 1e300, high = 0;
  const int middle = volume.side / 2;
  for (int i = 0; i < volume.side; ++i)
    for (int j = 0; j < volume.side; ++j)
      for (const double value : {volume.at(i, j, middle), volume.at(i, middle, j)}) {
        if (!std::isfinite(value)) continue;
        low = std::min(low, value);
        high = std::max(high, value);
      }
  if (!(high > low)) return {low - 0.5, low + 0.5, 0.5};
  const double step = round_step(high - low, 6);
  return {std::floor(low / step) * step, std::ceil(high / step) * step, step};
}

class Slice {
 public:
  Slice(const localization::TreVolume& volume, const Scale& scale, bool upright, double x0)
      : volume_(volume), scale_(scale), upright_(upright), x0_(x0), cell_(slice_px / volume.side) {}

  std::string svg() const {
    std::string text;
    const auto put = std::back_inserter(text);
    const int last = volume_.side - 1;
    for (int row = 0; row <= last; ++row)
      for (int column = 0; column <= last; ++column)
        if (const double value = at(column, row); std::isfinite(value))
          fmt::format_to(put,
                         R"(<rect x="{:.2f}" y="{:.2f}" width="{:.2f}" height="{:.2f}" fill="{}"/>)"
                         "\n",
                         x_of(column - 0.5), y_of(row + 0.5), cell_ + 0.3, cell_ + 0.3,
                         colour_of(scale_.share(value)));
    for (double level = scale_.low + scale_.step; level < scale_.high - 1e-9; level += scale_.step)
      if (const std::string path = path_of(level); !path.empty())
        fmt::format_to(put,
                       R"(<path d="{}" stroke="#fff" stroke-opacity="0.7" fill="none"/>)"
                       "\n",
                       path);
    const Eigen::Vector3d low = place(0, 0), high = place(last, last);
    const int up = upright_ ? 2 : 1;
    const double step = round_step(high.x() - low.x(), 6);
    for (double x = std::ceil(low.x() / step) * step; x <= high.x() + 1e-9; x += step)
      fmt::format_to(put,
                     R"(<text x="{:.1f}" y="{:.1f}" text-anchor="middle">{:g}</text>)"
                     "\n",
                     x_of((x - low.x()) / volume_.step_mm), top_px + slice_px + 18, x);
    for (double y = std::ceil(low(up) / step) * step; y <= high(up) + 1e-9; y += step)
      fmt::format_to(put,
                     R"(<text x="{:.1f}" y="{:.1f}" text-anchor="end">{:g}</text>)"
                     "\n",
                     x0_ - 6, y_of((y - low(up)) / volume_.step_mm) + 4, y);
    const int across = upright_ ? 1 : 2;
    fmt::format_to(put,
                   R"(<text x="{:.1f}" y="{:.1f}" text-anchor="middle">X, mm</text>)"
                   "\n"
                   R"(<text x="{:.1f}" y="{:.1f}">{}, mm, at {} = {:.1f} mm</text>)"
                   "\n",
                   x0_ + slice_px / 2, top_px + slice_px + 36, x0_, top_px - 12, upright_ ? "Z" : "Y",
                   upright_ ? "Y" : "Z", place(0, 0)(across));
    return text;
  }

 private:
  int middle() const { return volume_.side / 2; }
  double at(int column, int row) const {
    return upright_ ? volume_.at(column, middle(), row) : volume_.at(column, row, middle());
  }
  Eigen::Vector3d place(int column, int row) const {
    return upright_ ? volume_.place(column, middle(), row) : volume_.place(column, row, middle());
  }
  double x_of(double column) const { return x0_ + (column + 0.5) * cell_; }
  double y_of(double row) const { return top_px + slice_px - (row + 0.5) * cell_; }

  std::string path_of(double level) const {
    std::string path;
    for (const auto& [from, to] : isoline(
             volume_.side, volume_.side, [this](int column, int row) { return at(column, row); }, level))
      fmt::format_to(std::back_inserter(path), "M{:.1f} {:.1f}L{:.1f} {:.1f}", x_of(from[0]), y_of(from[1]),
                     x_of(to[0]), y_of(to[1]));
    return path;
  }

  const localization::TreVolume& volume_;
  const Scale& scale_;
  bool upright_;  ///< XOZ instead of XOY
  double x0_;
  double cell_;
};

std::string legend(const Scale& scale, double x0) {
  std::string text;
  const auto put = std::back_inserter(text);
  const int count = int(std::lround((scale.high - scale.low) / scale.step));
  constexpr int strips = 60;
  for (int k = 0; k < strips; ++k)
    fmt::format_to(put,
                   R"(<rect x="{:.1f}" y="{:.2f}" width="16" height="{:.2f}" fill="{}"/>)"
                   "\n",
                   x0, top_px + slice_px * (1 - double(k + 1) / strips), slice_px / strips + 0.3,
                   colour_of((k + 0.5) / strips));
  for (int k = 0; k <= count; ++k)
    fmt::format_to(put,
                   R"(<text x="{:.1f}" y="{:.1f}">{:.3g}</text>)"
                   "\n",
                   x0 + 22, top_px + slice_px * (1 - double(k) / count) + 4, scale.low + k * scale.step);
  fmt::format_to(put,
                 R"(<text x="{:.1f}" y="{:.1f}">TRE, mm rms</text>)"
                 "\n",
                 x0, top_px - 12);
  return text;
}

}  // namespace

std::string tre_figure(const localization::TreVolume& volume) {
  const Scale scale = scale_of(volume);
  const double second = left_px + slice_px + gap_px;
  const double third = second + slice_px + 30;
  return fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" width="{0}" height="{1}" )"
      R"(font-family="system-ui, sans-serif" font-size="12" role="img" aria-label="Predicted TRE">)"
      "\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n{2}{3}{4}</svg>\n",
      third + 100, top_px + slice_px + 50, Slice(volume, scale, false, left_px).svg(),
      Slice(volume, scale, true, second).svg(), legend(scale, third));
}

}  // namespace helicarm::report
