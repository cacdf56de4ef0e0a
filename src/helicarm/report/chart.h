// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace helicarm {

/// Points joined by a line, with a mark at each (one that is not finite breaks the line), or (`scattered`)
/// small dots alone.
struct ChartSeries {
  std::string name;  ///< for the legend; empty: not in it
  std::vector<std::array<double, 2>> points = {};
  bool scattered = false;
  bool dashed = false;
  std::vector<std::array<double, 2>> ranges = {};  ///< least and most at each point: bars, and no line
  bool joined = false;                             ///< a line all the same
};

/// A range of y that lies behind the curves: what was printed, say.
struct ChartBand {
  std::string name;
  double low;
  double high;
};

/// Lattice points whose surroundings are hatched; the first two kinds lean to different sides.
struct ChartHatching {
  std::string name;
  std::vector<bool> points;  ///< as the field's values
};

/// Values on a lattice, x fastest, drawn as isolines that carry their level.
struct ChartField {
  double x_first, y_first, step;
  int columns, rows;
  std::vector<double> values;
  std::vector<double> levels;
  std::vector<ChartHatching> hatchings = {};
};

struct Chart {
  std::string title;
  std::string x_label;  ///< with unit
  std::string y_label;
  std::vector<ChartSeries> series = {};
  std::optional<ChartBand> band = {};
  std::optional<ChartField> field = {};
  std::vector<std::string> x_names = {};  ///< of x = 0, 1, ...: instead of numbers
  std::vector<std::string> y_names = {};  ///< of y = 0, 1, ... downwards, likewise
  bool y_from_zero = false;
  bool image = false;                                 ///< y down, and the same scale both ways
  std::optional<double> y_most = {};                  ///< what lies higher is cut off
  std::string note = {};                              ///< a line below the title
  std::optional<std::array<double, 2>> y_range = {};  ///< instead of the curves' own
};

/// Charts side by side, `columns` in a row (0: up to three in one, more in rows of two), as one SVG document
/// with axes, ticks and legends. The same input gives the same bytes.
std::string chart_svg(std::span<const Chart> charts, std::size_t columns = 0);

}  // namespace helicarm
