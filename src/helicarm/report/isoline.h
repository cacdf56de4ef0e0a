// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <vector>

namespace helicarm::report {

/// A segment of an isoline within one lattice cell: column and row of both ends.
using IsolinePiece = std::array<std::array<double, 2>, 2>;

/// Marching squares: where the values `at(column, row)` cross a level. Cells with a NaN corner give none.
template <class At>
std::vector<IsolinePiece> isoline(int columns, int rows, At at, double level) {
  std::vector<IsolinePiece> pieces;
  constexpr int corners[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  for (int row = 0; row + 1 < rows; ++row)
    for (int column = 0; column + 1 < columns; ++column) {
      std::array<std::array<double, 2>, 4> crossings;
      std::size_t count = 0;
      for (int side = 0; side < 4; ++side) {
        const auto& from = corners[side];
        const auto& to = corners[(side + 1) % 4];
        const double a = at(column + from[0], row + from[1]) - level;
        const double b = at(column + to[0], row + to[1]) - level;
        if (!(a * b < 0)) continue;
        const double t = a / (a - b);
        crossings[count++] = {column + from[0] + t * (to[0] - from[0]),
                              row + from[1] + t * (to[1] - from[1])};
      }
      for (std::size_t i = 0; i + 1 < count; i += 2) pieces.push_back({crossings[i], crossings[i + 1]});
    }
  return pieces;
}

/// Adjacent marked lattice points: columns begin .. end - 1 of a row.
struct LatticeRun {
  int row, begin, end;
};

inline std::vector<LatticeRun> lattice_runs(int columns, const std::vector<bool>& marked) {
  std::vector<LatticeRun> runs;
  for (int i = 0; i < int(marked.size()); ++i) {
    if (!marked[std::size_t(i)]) continue;
    const int row = i / columns, column = i % columns;
    if (runs.empty() || runs.back().row != row || runs.back().end != column)
      runs.push_back({row, column, column});
    ++runs.back().end;
  }
  return runs;
}

}  // namespace helicarm::report
