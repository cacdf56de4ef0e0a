// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "helicarm/measures/measure.h"

namespace helicarm::measures {

/// A line through these pixels.
struct Stroke {
  std::vector<Eigen::Vector2d> path;
  bool is_fine = false;  ///< of a grid
};

/// The measure as lines in the clicks' pixels: for quadrants a grid of 25 %. Empty where `measure` refuses
/// the clicks.
std::vector<Stroke> drawing_of(Kind kind, std::span<const Click> clicks);

}  // namespace helicarm::measures
