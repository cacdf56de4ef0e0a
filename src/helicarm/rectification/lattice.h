// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "helicarm/detection/dot.h"
#include "helicarm/phantom/plate.h"

namespace helicarm {

/// A dot with its place on the lattice: position = index.x() a + index.y() b.
struct IndexedDot {
  std::size_t dot;  ///< place in the list that was searched
  Eigen::Vector2i index;
};

struct LatticeOptions {
  std::optional<double> pitch_px;  ///< where known; otherwise the commonest distance between neighbours
  double pitch_tolerance = 0.12;   ///< relative, when the pitch is known
  double match_tolerance = 0.22;   ///< of a dot to its predicted place, in pitches
  int max_gap = 3;                 ///< missing dots in a row that are bridged
};

struct IndexedLattice {
  std::vector<IndexedDot> dots;
  double pitch_px = 0;  ///< mean near the middle
};

/// Places dots on a distorted lattice, with dots missing or extra, from the images's geometry alone: a
/// regular neighbourhood is taken as the seed and grown with the local spacing. The lattice axes are the ones
/// nearest to +u and (square) +v, or (hexagonal) 60 degrees on from it. Fewer than 5 dots in place: an empty
/// lattice.
IndexedLattice index_lattice(const std::vector<Dot>& dots, Lattice kind, const LatticeOptions& options);

/// Lattice coordinates of an index in pitches: square (i, j); hexagonal (i + j/2, j sqrt(3)/2).
Eigen::Vector2d lattice_point(const Eigen::Vector2i& index, Lattice kind);

}  // namespace helicarm
