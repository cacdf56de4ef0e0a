// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "helicarm/detection/blobs.h"
#include "helicarm/detection/dot.h"
#include "helicarm/detection/fit_dot.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::detection {

struct CrossOptions {
  Polarity polarity = Polarity::dark;
  double min_width_px = 2.5;  ///< of the wires
  double max_width_px = 12;
  double least_angle_deg = 40;  ///< between the wires
  double max_sigma_px = 0.5;
};

/// Crossings of two wires with the sub-pixel intersection of their axes. `radius_px` is half the wires'
/// width. Round dots, single wires and wire ends are not crossings; black pixels (outside the field) and
/// those next to them are ignored.
std::vector<Dot> find_crosses(const xray::XrayImage& xray_image, const CrossOptions& options);

/// The crossing near `start` (centre, half width, contrast) of two wires at about the given angles (rad), or
/// nothing if the pixels show none. Pixels in `discs` are masked.
std::optional<Dot> fit_cross(const xray::XrayImage& xray_image, const Dot& start, double first_angle,
                             double second_angle, std::span<const Disc> discs);

}  // namespace helicarm::detection
