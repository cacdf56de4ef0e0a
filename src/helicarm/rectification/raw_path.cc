// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/raw_path.h"

#include <algorithm>
#include <cmath>

namespace helicarm::rectification {
namespace {

using Eigen::Vector2d;

/// Over this distance the distortion bends a line by less than 0.1 px.
constexpr double step_px = 16;

/// Part of a line (parameters from 0 to 1) in the image, or within half an image size of it if there is a
/// map: no map displaces farther.
std::pair<double, double> part_near(const DistortionMap& map, const Vector2d& from, const Vector2d& to) {
  const Vector2d size(map.width, map.height);
  std::pair<double, double> part{0, 1};
  for (int axis = 0; axis < 2; ++axis) {
    const double beyond = map.is_identity() ? -0.5 : 0.5 * size[axis];
    const double low = -0.5 - beyond - from[axis], high = size[axis] - 0.5 + beyond - from[axis];
    const double way = to[axis] - from[axis];
    if (way == 0 && (low > 0 || high < 0)) return {1, 0};
    if (way == 0) continue;
    part.first = std::max(part.first, std::min(low / way, high / way));
    part.second = std::min(part.second, std::max(low / way, high / way));
  }
  return part;
}

}  // namespace

std::vector<PixelPath> raw_paths(const DistortionMap& map, std::span<const Vector2d> rectified) {
  std::vector<PixelPath> paths(1);
  const auto cut = [&] {
    if (!paths.back().empty()) paths.emplace_back();
  };
  const auto add = [&](const Vector2d& position) {
    if (const auto raw = raw_in_image(map, position))
      paths.back().push_back(*raw);
    else
      cut();
  };
  for (std::size_t i = 1; i < rectified.size(); ++i) {
    const Vector2d way = rectified[i] - rectified[i - 1];
    const auto [first, last] = part_near(map, rectified[i - 1], rectified[i]);
    if (!(first <= last)) {
      cut();
      continue;
    }
    const double length = map.is_identity() ? 0 : (last - first) * way.norm();
    const int steps = std::max(1, static_cast<int>(std::ceil(length / step_px)));
    const bool goes_on = i > 1 && first == 0;
    if (!goes_on) cut();
    for (int k = goes_on ? 1 : 0; k <= steps; ++k)
      add(rectified[i - 1] + (first + (last - first) * k / steps) * way);
    if (last < 1) cut();
  }
  std::erase_if(paths, [](const PixelPath& path) { return path.size() < 2; });
  return paths;
}

}  // namespace helicarm::rectification
