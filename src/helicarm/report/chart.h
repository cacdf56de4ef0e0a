// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace helicarm::report {

/// Points joined by a line with a marker at each (a non-finite value breaks the line), or (`scattered`) small
/// dots without a line.
struct ChartSeries {
  std::string name;  ///< in the legend; empty: not listed
  std::vector<std::array<double, 2>> points = {};
  bool scattered = false;
  bool dashed = false;
  std::vector<std::array<double, 2>> ranges =
      {};               ///< minimum and maximum at each point: bars instead of a line
  bool joined = false;  ///< draws the line as well
};

/// A range of y drawn behind the curves, for example a published one.
struct ChartBand {
  std::string name;
  double low;
  double high;
};

/// Lattice points to hatch; the first two kinds have opposite slopes.
struct ChartHatching {
  std::string name;
  std::vector<bool> points;  ///< in the order of the field's values
};

/// Values on a lattice, x fastest, drawn as labelled isolines.
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
  std::vector<std::string> x_names = {};  ///< tick labels of x = 0, 1, ... instead of numbers
  std::vector<std::string> y_names = {};  ///< tick labels of y = 0, 1, ... downwards
  bool y_from_zero = false;
  bool image = false;                                 ///< y downwards, equal scales
  std::optional<double> y_most = {};                  ///< values above are clipped
  std::string note = {};                              ///< a line below the title
  std::optional<std::array<double, 2>> y_range = {};  ///< instead of the range of the curves
};

/// Charts in rows of `columns` (0: up to three in one row, more in rows of two) as one SVG document with
/// axes, ticks and legends. Equal input gives equal bytes.
std::string chart_svg(std::span<const Chart> charts, std::size_t columns = 0);

}  // namespace helicarm::report
