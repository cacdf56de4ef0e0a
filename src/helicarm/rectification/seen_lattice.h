// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/detection/dot.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/rectification/lattice.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::rectification {

inline constexpr std::size_t least_plate_dots = 10;

/// Pixels per plate millimetre at the image centre, if file and plate provide it.
std::optional<double> expected_scale(const xray::XrayImage& xray_image, const phantom::Plate& plate);

/// Dots of one size, and those of them that form a lattice.
struct SeenLattice {
  std::vector<detection::Dot> dots;
  IndexedLattice lattice;
};

/// The dots as a lattice: of the expected pitch if known, else of the pitch that gives the largest lattice.
SeenLattice seen_lattice(const std::vector<detection::Dot>& dots, const phantom::Plate& plate,
                         std::optional<double> scale);

}  // namespace helicarm::rectification
