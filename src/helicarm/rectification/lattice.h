// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "helicarm/detection/dot.h"
#include "helicarm/phantom/plate.h"

namespace helicarm::rectification {

/// A dot with its lattice index: position = index.x() a + index.y() b.
struct IndexedDot {
  std::size_t dot;  ///< index in the input list
  Eigen::Vector2i index;
};

struct LatticeOptions {
  std::optional<double> pitch_px;  ///< if known; otherwise the most frequent distance between neighbours
  double pitch_tolerance = 0.12;   ///< relative, when the pitch is known
  double match_tolerance = 0.22;   ///< distance of a dot from its predicted position, in pitches
  int max_gap = 3;                 ///< consecutive missing dots that are bridged
};

struct IndexedLattice {
  std::vector<IndexedDot> dots;
  double pitch_px = 0;  ///< mean near the image centre
};

/// Indexes dots of a distorted lattice with missing and extra dots, from the image geometry alone: a regular
/// neighbourhood is the seed and is grown with the local spacing. The lattice axes are those nearest to +u
/// and (square) +v, or (hexagonal) 60 degrees from it. Fewer than 5 indexed dots give an empty lattice.
IndexedLattice index_lattice(const std::vector<detection::Dot>& dots, phantom::Lattice kind,
                             const LatticeOptions& options);

/// Lattice coordinates of an index in pitches: square (i, j); hexagonal (i + j/2, j sqrt(3)/2).
Eigen::Vector2d lattice_point(const Eigen::Vector2i& index, phantom::Lattice kind);

}  // namespace helicarm::rectification
