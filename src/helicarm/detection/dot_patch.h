// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/detection/fit_dot.h"
#include "helicarm/image/image.h"

namespace helicarm::detection {

/// Aligned, so that the order of summation does not depend on the address.
using Floats = std::vector<float, Eigen::aligned_allocator<float>>;

/// Pixels around dots as columns, ordered by octant about the origin and padded with zero-weight pixels to a
/// multiple of the SIMD width.
struct DotPatch {
  static constexpr std::size_t octants = 8;
  Eigen::Index count = 0;
  std::array<Eigen::Index, octants + 1> octant_start{};
  Floats x, y;  ///< from the origin, px
  Floats grey, weight;
  std::vector<char> clipped;  ///< the true value is at least `grey`
  std::vector<int> cell;      ///< index in a grid of width `side`
  int side = 0;
  float inverse_window = 0;
  float scale = 1;  ///< grey values are divided by it
};

/// The pixels inside the windows (about the origin u, v) and outside the masked discs. Nothing if too few are
/// usable.
std::optional<DotPatch> gather_dot_patch(const image::Image<float>& image, int u, int v,
                                         std::span<const Disc> windows, std::span<const Disc> others,
                                         const DotFitOptions& options);

}  // namespace helicarm::detection
