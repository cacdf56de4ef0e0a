// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/chart.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include <fmt/format.h>

#include "helicarm/report/axis.h"
#include "helicarm/report/chart_style.h"
#include "helicarm/report/isoline.h"
#include "helicarm/report/markup.h"

namespace helicarm::report {
namespace {

constexpr double chart_width = 460, chart_height = 360;  // of the frame
constexpr double left_margin = 64, top_margin = 56, right_margin = 28, bottom_margin = 56;
constexpr double legend_line = 17, legend_mark = 26;
constexpr double letter_width = 6.5;  // of a tick name; mean width, an upper bound
constexpr std::size_t few_dots = 50;  // more are drawn smaller and translucent

/// Colour-blind safe palette of Okabe and Ito.
constexpr std::array series_colours{"#0072b2", "#d55e00", "#009e73", "#cc79a7",
                                    "#e69f00", "#56b4e9", "#000000"};

class ChartDrawing {
 public:
  ChartDrawing(const Chart& chart, std::size_t number, double x0) : chart_(chart), number_(number), x0_(x0) {
    double x_low = infinity, x_high = -infinity, y_low = infinity, y_high = -infinity;
    const auto include = [&](double x, double y) {
      if (!std::isfinite(x) || !std::isfinite(y)) return;
      x_low = std::min(x_low, x), x_high = std::max(x_high, x);
      y_low = std::min(y_low, y), y_high = std::max(y_high, y);
    };
    for (const ChartSeries& series : chart.series) {
      for (const auto& [x, y] : series.points) include(x, y);
      for (std::size_t i = 0; i < series.ranges.size(); ++i)
        for (const double y : series.ranges[i]) include(series.points[i][0], y);
    }
    if (chart.field) {
      const ChartField& f = *chart.field;
      include(f.x_first, f.y_first);
      include(f.x_first + f.step * (f.columns - 1), f.y_first + f.step * (f.rows - 1));
    }
    if (chart.band) y_low = std::min(y_low, chart.band->low), y_high = std::max(y_high, chart.band->high);
    if (!(x_low <= x_high)) x_low = y_low = 0, x_high = y_high = 1;
    if (chart.y_from_zero) y_low = std::min(0.0, y_low);
    if (chart.y_most) y_high = std::min(y_high, *chart.y_most);
    if (chart.y_range) y_low = chart.y_range->front(), y_high = chart.y_range->back();
    const auto axis = [](const std::vector<std::string>& names, double low, double high) {
      return names.empty() ? Axis::over(low, high) : Axis{-0.5, double(names.size()) - 0.5, 1};
    };
    x_ = axis(chart.x_names, x_low, x_high);
    y_ = axis(chart.y_names, y_low, y_high);
    if (chart.image) share_scale();
    if (chart.field) x_.low = x_low, x_.high = x_high, y_.low = y_low, y_.high = y_high;
    if (chart.field) x_.step = y_.step = round_step(x_high - x_low, Axis::about_ticks);
  }

  std::string svg() {
    frame();
    put(R"(<clipPath id="frame{0}"><rect x="{1}" y="{2}" width="{3}" height="{4}"/></clipPath>)"
        "\n<g clip-path=\"url(#frame{0})\">\n",
        number_, x0_, top_margin, chart_width, chart_height);
    if (chart_.band) band(*chart_.band);
    if (chart_.field) field(*chart_.field);
    for (std::size_t i = 0; i < chart_.series.size(); ++i) series(chart_.series[i], colour(i));
    text_ += "</g>\n";
    legend();
    return std::move(text_);
  }
  double legend_height() const { return legend_line * legend_lines_; }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();

  static const char* colour(std::size_t i) { return series_colours[i % series_colours.size()]; }
  double px(double x) const { return x0_ + chart_width * x_.share(x); }
  double py(double y) const {
    const bool down = chart_.image || !chart_.y_names.empty();
    return top_margin + chart_height * (down ? y_.share(y) : 1 - y_.share(y));
  }

  /// Widens the axis with the larger frame side, for equal scales.
  void share_scale() {
    const double scale = std::max((x_.high - x_.low) / chart_width, (y_.high - y_.low) / chart_height);
    for (const auto& [axis, length] : {std::pair{&x_, chart_width}, std::pair{&y_, chart_height}}) {
      const double middle = 0.5 * (axis->low + axis->high);
      axis->low = middle - 0.5 * scale * length;
      axis->high = middle + 0.5 * scale * length;
    }
  }

  template <class... Values>
  void put(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
  }

  void frame() {
    const double bottom = top_margin + chart_height;
    for (const auto& [x, name] : ticks(x_, chart_.x_names))
      put(R"(<path d="M{0:.1f} {1}V{2}" class="grid"/><text x="{0:.1f}" y="{3}" class="middle">{4}</text>)"
          "\n",
          px(x), top_margin, bottom, bottom + 18, escaped(name));
    for (const auto& [y, name] : ticks(y_, chart_.y_names))
      put(R"(<path d="M{0} {1:.1f}H{2}" class="grid"/><text x="{3}" y="{4:.1f}" class="end">{5}</text>)"
          "\n",
          x0_, py(y), x0_ + chart_width, x0_ - 7, py(y) + 4, escaped(name));
    put(R"(<rect x="{}" y="{}" width="{}" height="{}" class="frame"/>)"
        "\n",
        x0_, top_margin, chart_width, chart_height);
    put(R"(<text x="{}" y="{}" class="middle">{}</text>)"
        "\n",
        x0_ + chart_width / 2, bottom + 40, escaped(chart_.x_label));
    put(R"-(<text transform="translate({} {}) rotate(-90)" class="middle">{}</text>)-"
        "\n",
        x0_ - 44, top_margin + chart_height / 2, escaped(chart_.y_label));
    put(R"(<text x="{}" y="{}" class="title">{}</text>)"
        "\n",
        x0_, top_margin - 28, escaped(chart_.title));
    put(R"(<text x="{}" y="{}" class="note">{}</text>)"
        "\n",
        x0_, top_margin - 10, escaped(chart_.note));
  }

  void band(const ChartBand& band) {
    put(R"(<rect x="{}" y="{:.1f}" width="{}" height="{:.1f}" class="band"/>)"
        "\n",
        x0_, py(band.high), chart_width, py(band.low) - py(band.high));
  }

  void series(const ChartSeries& series, const char* colour) {
    if (series.scattered) {
      const bool few = series.points.size() <= few_dots;
      put("<g fill=\"{}\" fill-opacity=\"{}\">\n", colour, few ? 1 : 0.35);
      for (const auto& [x, y] : series.points)
        if (std::isfinite(x) && std::isfinite(y) && y_.share(y) <= 1.02)
          put("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\"/>\n", px(x), py(y), few ? 3.5 : 1.6);
      text_ += "</g>\n";
      return;
    }
    for (std::size_t i = 0; i < series.ranges.size(); ++i)
      put(R"(<path d="M{0:.1f} {1:.1f}V{2:.1f}" class="line" stroke="{3}"{5}/><circle cx="{0:.1f}" cy="{4:.1f}" r="4" fill="{3}"/>)"
          "\n",
          px(series.points[i][0]), py(series.ranges[i][0]), py(series.ranges[i][1]), colour,
          py(series.points[i][1]), series.dashed ? " stroke-dasharray=\"6 4\"" : "");
    if (!series.ranges.empty() && !series.joined) return;
    std::string path, marks;
    bool broken = true;
    for (const auto& [x, y] : series.points) {
      if (!std::isfinite(x) || !std::isfinite(y)) {
        broken = true;
        continue;
      }
      fmt::format_to(std::back_inserter(path), "{}{:.1f} {:.1f}", broken ? 'M' : 'L', px(x), py(y));
      broken = false;
      if (series.points.size() > 2)
        fmt::format_to(std::back_inserter(marks), R"(<circle cx="{:.1f}" cy="{:.1f}" r="3"/>)", px(x), py(y));
    }
    put("<path d=\"{}\" class=\"line\" stroke=\"{}\"{}/>\n<g fill=\"{}\">{}</g>\n", path, colour,
        series.dashed ? " stroke-dasharray=\"6 4\"" : "", colour, marks);
  }

  std::string hatch(std::size_t kind) const { return fmt::format("hatch{}-{}", number_, kind); }

  void hatching(const ChartField& field, std::size_t kind) {
    put(R"-(<pattern id="{}" patternUnits="userSpaceOnUse" width="7" height="7" patternTransform="rotate({})">)-"
        R"-(<path d="M0 0V7" class="hatch"/></pattern>)-"
        "\n",
        hatch(kind), kind % 2 == 0 ? 45 : -45);
    const auto x_of = [&](int column) { return px(field.x_first + field.step * (column - 0.5)); };
    const auto y_of = [&](int row) { return py(field.y_first + field.step * (row - 0.5)); };
    std::string path;
    for (const auto& [row, begin, end] : lattice_runs(field.columns, field.hatchings[kind].points))
      fmt::format_to(std::back_inserter(path), "M{0:.1f} {1:.1f}H{2:.1f}V{3:.1f}H{0:.1f}Z", x_of(begin),
                     y_of(row), x_of(end), y_of(row + 1));
    put("<path d=\"{}\" fill=\"url(#{})\"/>\n", path, hatch(kind));
  }

  void field(const ChartField& field) {
    for (std::size_t kind = 0; kind < field.hatchings.size(); ++kind) hatching(field, kind);
    const auto at = [&](int column, int row) {
      return field.values[std::size_t(row) * std::size_t(field.columns) + std::size_t(column)];
    };
    for (std::size_t i = 0; i < field.levels.size(); ++i) {
      const double level = field.levels[i];
      const auto pieces = isoline(field.columns, field.rows, at, level);
      if (pieces.empty()) continue;
      const auto x_of = [&](double column) { return px(field.x_first + field.step * column); };
      const auto y_of = [&](double row) { return py(field.y_first + field.step * row); };
      std::string path;
      // Each label stands where its line is nearest to a diagonal through the centre, the next diagonal for
      // each line.
      const double way = 0.6 + 0.9 * double(i);
      constexpr double nowhere = 3;
      double best = nowhere, label_x = 0, label_y = 0;
      for (const auto& [from, to] : pieces) {
        fmt::format_to(std::back_inserter(path), "M{:.1f} {:.1f}L{:.1f} {:.1f}", x_of(from[0]), y_of(from[1]),
                       x_of(to[0]), y_of(to[1]));
        const double across = (from[0] - (field.columns - 1) / 2.0), up = (from[1] - (field.rows - 1) / 2.0);
        const double length = std::hypot(across, up);
        const bool inside = std::abs(across) < 0.45 * field.columns && std::abs(up) < 0.45 * field.rows;
        const double off =
            length > 0 && inside ? 1 - (across * std::cos(way) + up * std::sin(way)) / length : nowhere;
        if (off < best) best = off, label_x = x_of(from[0]), label_y = y_of(from[1]);
      }
      put("<path d=\"{}\" class=\"line\" stroke=\"{}\"/>\n", path, colour(0));
      if (best < nowhere)
        put("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"level\">{:.3g}</text>\n", label_x, label_y + 4, level);
    }
  }

  void legend() {
    const auto add = [&](const std::string& mark, const std::string& name) {
      put(R"-(<g transform="translate({} {})">{}<text x="{}" y="4">{}</text></g>)-"
          "\n",
          x0_, top_margin + chart_height + bottom_margin + legend_line * (legend_lines_++ + 0.3), mark,
          legend_mark + 8, escaped(name));
    };
    if (chart_.band)
      add(fmt::format(R"(<rect y="-5" width="{}" height="10" class="band"/>)", legend_mark),
          chart_.band->name);
    for (std::size_t kind = 0; chart_.field && kind < chart_.field->hatchings.size(); ++kind)
      add(fmt::format(R"-(<rect y="-6" width="{}" height="12" fill="url(#{})" class="hatch"/>)-", legend_mark,
                      hatch(kind)),
          chart_.field->hatchings[kind].name);
    for (std::size_t i = 0; i < chart_.series.size(); ++i) {
      const ChartSeries& series = chart_.series[i];
      if (series.name.empty()) continue;
      add(series.scattered ? fmt::format(R"(<circle cx="{}" r="3" fill="{}"/>)", legend_mark / 2, colour(i))
                           : fmt::format(R"(<path d="M0 0H{}" class="line" stroke="{}"{}/>)", legend_mark,
                                         colour(i), series.dashed ? " stroke-dasharray=\"6 4\"" : ""),
          series.name);
    }
  }

  const Chart& chart_;
  std::size_t number_;  ///< in the document
  double x0_;
  Axis x_{}, y_{};
  int legend_lines_ = 0;
  std::string text_;
};

}  // namespace

std::string chart_svg(std::span<const Chart> charts, std::size_t columns) {
  if (columns == 0) columns = charts.size() > 3 ? 2 : std::max<std::size_t>(1, charts.size());
  std::string body, title;
  double width = 0, height = 0;
  for (std::size_t first = 0; first < charts.size(); first += columns) {
    double x = left_margin, legends = 0;
    body += fmt::format("<g transform=\"translate(0 {})\">\n", height);
    for (std::size_t i = first; i < std::min(first + columns, charts.size()); ++i) {
      const Chart& chart = charts[i];
      double names = 0;
      title += (title.empty() ? "" : "; ") + chart.title;
      for (const std::string& name : chart.y_names)
        names = std::max(names, letter_width * double(name.size()));
      x += std::max(0.0, names - left_margin);
      ChartDrawing drawing(chart, i, x);
      body += drawing.svg();
      legends = std::max(legends, drawing.legend_height());
      x += chart_width + left_margin + right_margin;
    }
    body += "</g>\n";
    width = std::max(width, x - left_margin);
    height += top_margin + chart_height + bottom_margin + legends;
  }
  return fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {0} {1}" width="{0}" height="{1}" )"
      R"(font-family="system-ui, sans-serif" font-size="12" role="img" aria-label="{2}">)"
      "\n<style>{3}</style>\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n{4}</svg>\n",
      width, height, escaped(title), chart_style, body);
}

}  // namespace helicarm::report
