// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/rectification/lattice.h"

namespace helicarm::rectification {

/// A dot of the image and its position on the plate.
struct PlateDot {
  std::size_t dot;
  Eigen::Vector2d place_mm;  ///< in pitches if the plate has no pitch
};

/// Finds the plate's placement: the rotation, mirroring and shift that explains the indexed dots best and,
/// among equals, is nearest to the raw image. For an unbounded lattice the indices are used as they are.
/// plate_mismatch if many dots are at positions where the plate has none.
Expected<std::vector<PlateDot>> match_plate(const IndexedLattice& lattice,
                                            const std::vector<detection::Dot>& dots,
                                            const phantom::Plate& plate, const Eigen::Vector2d& image_centre);

}  // namespace helicarm::rectification
