// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/detection/fit_dot.h"
#include "helicarm/image/image.h"

namespace helicarm {

/// Aligned, so that sums add up in the same order wherever they lie.
using Floats = std::vector<float, Eigen::aligned_allocator<float>>;

/// The pixels around dots as columns, octant by octant about the origin, filled up with weightless ones to a
/// multiple of the registers' width.
struct DotPatch {
  static constexpr std::size_t octants = 8;
  Eigen::Index count = 0;
  std::array<Eigen::Index, octants + 1> octant_start{};
  Floats x, y;  ///< from the origin, px
  Floats grey, weight;
  std::vector<char> clipped;  ///< the true value is at least `grey`
  std::vector<int> cell;      ///< place in a grid of width `side`
  int side = 0;
  float inverse_window = 0;
  float scale = 1;  ///< grey values are divided by it
};

/// The pixels within the windows (about the origin u, v) and not within others. Nothing where too few are
/// open.
std::optional<DotPatch> gather_dot_patch(const Image<float>& image, int u, int v,
                                         std::span<const Disc> windows, std::span<const Disc> others,
                                         const DotFitOptions& options);

}  // namespace helicarm
