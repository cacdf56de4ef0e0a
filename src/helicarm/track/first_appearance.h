// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/track/marker_image.h"

namespace helicarm::track {

/// Where a marker is picked in a view.
struct PickedPlace {
  std::size_t marker;
  Eigen::Vector2d uv_raw;
  double radius_px;  ///< by the stated diameter
};

/// Logarithms of fitted over stated sizes that fit as well as the best: a blurred small disc looks almost
/// like a sharp large one.
struct SizeRange {
  double low = 0, high = 0, sigma = 0;
  std::size_t markers = 0;
};

/// Polarity, profile and size of a view's markers.
struct LearntAppearance {
  MarkerAppearance appearance;
  SizeRange sizes;
};

/// By the picked discs within `reach_px` and a radius: the profile that leaves the least residual of the most
/// markers; of profiles that fit alike the one whose size is the stated one.
LearntAppearance learnt_appearance(const xray::XrayImage& image, std::span<const PickedPlace> picks,
                                   double reach_px);

/// Nothing where a view's discs agree with the stated size, or are too few.
std::optional<Warning> size_contradiction(const std::vector<SizeRange>& views, double diameter_mm);

}  // namespace helicarm::track
