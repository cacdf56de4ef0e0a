// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/dot_patch.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>

namespace helicarm::detection {

std::optional<DotPatch> gather_dot_patch(const image::Image<float>& image, int u, int v,
                                         std::span<const Disc> windows, std::span<const Disc> others,
                                         const DotFitOptions& options) {
  DotPatch patch;
  double window = 0;
  for (const Disc& disc : windows) window = std::max(window, disc.centre.norm() + disc.radius);
  patch.inverse_window = float(1 / window);
  const int half = static_cast<int>(std::ceil(window));
  patch.side = 2 * half + 1;
  std::vector<Disc> near;
  for (const Disc& disc : others)
    if (std::hypot(disc.centre.x() - u, disc.centre.y() - v) < window + disc.radius)
      near.push_back({disc.centre - Eigen::Vector2d(u, v), disc.radius});
  const auto within = [](std::span<const Disc> discs, double x, double y) {
    return std::any_of(discs.begin(), discs.end(), [&](const Disc& disc) {
      const double dx = x - disc.centre.x();
      const double dy = y - disc.centre.y();
      return dx * dx + dy * dy <= disc.radius * disc.radius;
    });
  };
  struct Pixel {
    int x, y;
    float grey;
    std::size_t octant;
  };
  std::vector<Pixel> pixels(static_cast<std::size_t>(patch.side * patch.side));
  std::array<std::size_t, DotPatch::octants + 1> starts{};
  std::size_t count = 0;
  int inside = 0;
  int open = 0;
  double sum = 0;
  for (int y = -half; y <= half; ++y)
    for (int x = -half; x <= half; ++x) {
      if (!within(windows, x, y)) continue;
      ++inside;
      if (!image.contains(u + x, v + y)) continue;
      const float grey = image(u + x, v + y);
      if (grey <= options.floor || within(near, x, y)) continue;
      const auto octant = static_cast<std::size_t>(4 * (y >= 0) + 2 * (x >= 0) + (std::abs(x) > std::abs(y)));
      pixels[count++] = {x, y, grey, octant};
      ++starts[octant + 1];
      open += grey < options.ceiling;
      sum += double(grey);
    }
  std::partial_sum(starts.begin(), starts.end(), starts.begin());
  for (std::size_t k = 0; k < starts.size(); ++k)
    patch.octant_start[k] = static_cast<Eigen::Index>(starts[k]);
  if (open < 30 || double(count) < 0.4 * inside) return std::nullopt;
  patch.count = static_cast<Eigen::Index>(count);
  patch.scale = std::max(1e-3f, float(std::abs(sum)) / float(count));
  const std::size_t whole = (count + 7) / 8 * 8;
  for (auto* column : {&patch.x, &patch.y, &patch.grey}) column->resize(whole);
  patch.clipped.resize(whole);
  patch.cell.resize(count);
  patch.weight.assign(count, 1);
  patch.weight.resize(whole, 0);
  for (std::size_t k = 0; k < count; ++k) {
    const Pixel& pixel = pixels[k];
    const std::size_t at = starts[pixel.octant]++;
    patch.x[at] = float(pixel.x);
    patch.y[at] = float(pixel.y);
    patch.grey[at] = pixel.grey / patch.scale;
    patch.clipped[at] = pixel.grey >= options.ceiling;
    patch.cell[at] = (pixel.y + half) * patch.side + pixel.x + half;
  }
  return patch;
}

}  // namespace helicarm::detection
