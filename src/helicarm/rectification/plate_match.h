// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/rectification/lattice.h"

namespace helicarm {

/// A dot of the image and its place on the plate.
struct PlateDot {
  std::size_t dot;
  Eigen::Vector2d place_mm;  ///< in pitches where the plate has no pitch
};

/// Finds how the plate lies: which of its turned, mirrored and shifted positions explains the indexed dots,
/// and of equal ones the one nearest the raw image. An unbounded lattice takes the indices as they are.
/// plate_mismatch where dots stand in numbers where the plate has none.
Expected<std::vector<PlateDot>> match_plate(const IndexedLattice& lattice, const std::vector<Dot>& dots,
                                            const Plate& plate, const Eigen::Vector2d& image_centre);

}  // namespace helicarm
