// SPDX-License-Identifier: Apache-2.0
// PDF 1.4 (ISO 32000-1): pages of text and lines in three of the standard fonts, uncompressed.
#include "helicarm/report/pdf_document.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

namespace helicarm::report {
namespace {

// Points, 1/72 inch, of A4.
constexpr double paper_width = 595, paper_height = 842, page_margin = 40, page_bottom = 60;
constexpr double content_width = paper_width - 2 * page_margin;
constexpr double text_size = 9, fixed_advance = 0.6;  // of Courier, in sizes
constexpr std::array<const char*, 4> curve_inks{"0.12 0.35 0.65", "0.85 0.4 0.1", "0.85 0.4 0.1",
                                                "0.2 0.2 0.2"};

std::size_t characters(std::string_view utf8) {
  return std::size_t(std::ranges::count_if(utf8, [](char c) { return (c & 0xC0) != 0x80; }));
}

/// WinAnsiEncoding, escaped for a string in parentheses.
std::string pdf_string(std::string_view utf8) {
  std::string text;
  for (std::size_t i = 0; i < utf8.size();) {
    const auto lead = static_cast<unsigned char>(utf8[i]);
    const std::size_t length = lead < 0x80 ? 1 : lead < 0xE0 ? 2 : lead < 0xF0 ? 3 : 4;
    unsigned code = length == 1 ? lead : lead & (0xFFu >> (length + 1));
    for (std::size_t k = 1; k < length && i + k < utf8.size(); ++k)
      code = code << 6 | (static_cast<unsigned char>(utf8[i + k]) & 0x3F);
    i += length;
    constexpr unsigned en_dash = 0x2013, minus = 0x2212;
    if (code == en_dash) code = 0x96;
    if (code == minus) code = '-';
    if (code > 0xFF || code < 0x20) code = '?';
    if (code == '(' || code == ')' || code == '\\') text += '\\';
    text += static_cast<char>(code);
  }
  return text;
}

/// Width of Helvetica, roughly: an average letter.
double plain_width(std::string_view utf8, double size) { return 0.5 * size * double(characters(utf8)); }

struct PlotRange {
  double low = std::numeric_limits<double>::infinity(), high = -std::numeric_limits<double>::infinity();

  void hold(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value), high = std::max(high, value);
  }
  void widen() {
    if (!(high > low)) low -= 0.5, high += 0.5;
    const double margin = 0.04 * (high - low);
    low -= margin, high += margin;
  }
  double share(double value) const { return (value - low) / (high - low); }
};

/// About five round values.
std::vector<double> round_steps(const PlotRange& range) {
  const double rough = (range.high - range.low) / 5, decade = std::pow(10, std::floor(std::log10(rough)));
  const double step = decade * (rough > 5 * decade ? 10 : rough > 2 * decade ? 5 : rough > decade ? 2 : 1);
  std::vector<double> steps;
  for (double at = std::ceil(range.low / step) * step; at <= range.high; at += step)
    steps.push_back(std::abs(at) < step / 1000 ? 0 : at);
  return steps;
}

}  // namespace

PdfDocument::PdfDocument(std::string title, std::string footer)
    : title_(std::move(title)), footer_(std::move(footer)) {
  begin_page();
  heading(title_, true);
}

void PdfDocument::begin_page() {
  pages_.emplace_back();
  y_ = paper_height - page_margin;
  const double number_x = paper_width - page_margin - 20;
  text(page_margin, page_margin - 10, 7, footer_);
  text(number_x, page_margin - 10, 7, std::to_string(pages_.size()));
}

void PdfDocument::need(double height) {
  if (y_ - height < page_bottom) begin_page();
}

void PdfDocument::text(double x, double y, double size, std::string_view utf8, Font font) {
  pages_.back() += fmt::format("BT /F{} {:.1f} Tf {:.2f} {:.2f} Td ({}) Tj ET\n", int(font) + 1, size, x, y,
                               pdf_string(utf8));
}

void PdfDocument::line(const std::vector<std::array<double, 2>>& points, double width, const char* ink,
                       bool dashed) {
  if (points.size() < 2) return;
  std::string path = fmt::format("{} RG {:.2f} w {} d\n", ink, width, dashed ? "[4 3] 0" : "[] 0");
  for (std::size_t i = 0; i < points.size(); ++i)
    path += fmt::format("{:.2f} {:.2f} {}\n", points[i][0], points[i][1], i == 0 ? "m" : "l");
  pages_.back() += path + "S\n";
}

void PdfDocument::dot(double x, double y, const char* ink) {
  constexpr double side = 2.4;
  pages_.back() +=
      fmt::format("{} rg {:.2f} {:.2f} {} {} re f 0 g\n", ink, x - side / 2, y - side / 2, side, side);
}

void PdfDocument::heading(std::string_view words, bool is_title) {
  const double size = is_title ? 16 : 11;
  need(4 * size);
  y_ -= 1.6 * size;
  text(page_margin, y_, size, words, Font::bold);
  y_ -= 0.5 * size;
}

void PdfDocument::paragraph(std::string_view words) {
  const double height = 1.35 * text_size;
  std::string row;
  const auto flush = [&] {
    need(height);
    y_ -= height;
    text(page_margin, y_, text_size, row);
    row.clear();
  };
  while (!words.empty()) {
    const std::size_t end = std::min(words.find(' '), words.size());
    const std::string_view word = words.substr(0, end);
    if (!row.empty() && plain_width(row, text_size) + plain_width(word, text_size) > content_width) flush();
    if (!row.empty()) row += ' ';
    row += word;
    words.remove_prefix(std::min(end + 1, words.size()));
  }
  if (!row.empty()) flush();
  y_ -= 3;
}

void PdfDocument::table(const Table& table) {
  heading(table.heading);
  const std::size_t columns = table.columns.size();
  std::vector<std::size_t> widths(columns);
  const auto shown = [](const Cell& cell) { return cell.is_bad ? cell.text + " !" : cell.text; };
  for (std::size_t c = 0; c < columns; ++c) {
    widths[c] = characters(table.columns[c].title);
    for (const auto& row : table.rows) widths[c] = std::max(widths[c], characters(shown(row[c])));
  }
  std::size_t total = 2 * columns;
  for (const std::size_t width : widths) total += width;
  const double size =
      std::min(8.0, content_width / (fixed_advance * double(std::max<std::size_t>(1, total))));
  const auto put = [&](std::size_t c, std::size_t before, const std::string& words, Font font) {
    const std::size_t indent = table.columns[c].is_number ? widths[c] - characters(words) : 0;
    text(page_margin + fixed_advance * size * double(before + indent), y_, size, words, font);
  };
  const auto head = [&] {
    y_ -= 1.5 * size;
    std::size_t before = 0;
    for (std::size_t c = 0; c < columns; before += widths[c++] + 2)
      put(c, before, table.columns[c].title, Font::fixed);
    line({{page_margin, y_ - 3}, {paper_width - page_margin, y_ - 3}}, 0.5, "0 0 0");
    y_ -= 3;
  };
  need(5 * size);
  head();
  for (const auto& row : table.rows) {
    if (y_ - 1.4 * size < page_bottom) {
      begin_page();
      head();
    }
    y_ -= 1.4 * size;
    std::size_t before = 0;
    for (std::size_t c = 0; c < columns; before += widths[c++] + 2)
      put(c, before, shown(row[c]), Font::fixed);
  }
  y_ -= size;
}

void PdfDocument::chart(const Chart& chart) {
  constexpr double height = 150, left = 50, below = 30, above = 24, width = 0.75 * content_width;
  need(height + below + above);
  y_ -= above;
  text(page_margin, y_ + 10, text_size, chart.title + ", " + chart.y_label, Font::bold);
  if (!chart.note.empty()) text(page_margin, y_ + 1, 7, chart.note);
  PlotRange x, y;
  for (const ChartSeries& series : chart.series)
    for (const auto& point : series.points) x.hold(point[0]), y.hold(point[1]);
  if (!(x.high >= x.low)) return;
  x.widen(), y.widen();
  const double x0 = page_margin + left, y0 = y_ - height;
  const auto at = [&](const std::array<double, 2>& point) {
    return std::array<double, 2>{x0 + width * x.share(point[0]), y0 + height * y.share(point[1])};
  };
  for (const double value : round_steps(x)) {
    line({at({value, y.low}), at({value, y.high})}, 0.3, "0.85 0.85 0.85");
    text(at({value, y.low})[0] - 8, y0 - 9, 7, fmt::format("{:.6g}", value));
  }
  for (const double value : round_steps(y)) {
    line({at({x.low, value}), at({x.high, value})}, 0.3, "0.85 0.85 0.85");
    text(page_margin, at({x.low, value})[1] - 2, 7, fmt::format("{:.6g}", value));
  }
  line({{x0, y0}, {x0 + width, y0}, {x0 + width, y0 + height}, {x0, y0 + height}, {x0, y0}}, 0.5, "0 0 0");
  std::string legend;
  for (std::size_t s = 0; s < chart.series.size(); ++s) {
    const ChartSeries& series = chart.series[s];
    const char* ink = curve_inks[std::min(s, curve_inks.size() - 1)];
    std::vector<std::array<double, 2>> path;
    for (const auto& point : series.points) {
      if (series.scattered && std::isfinite(point[1])) dot(at(point)[0], at(point)[1], ink);
      if (!std::isfinite(point[1])) line(std::exchange(path, {}), 0.9, ink, series.dashed);
      if (!series.scattered && std::isfinite(point[1])) path.push_back(at(point));
    }
    line(path, 0.9, ink, series.dashed);
    if (series.name.empty()) continue;
    legend += (legend.empty() ? "" : "; ") + series.name +
              (series.scattered ? " (dots)"
               : series.dashed  ? " (dashed)"
                                : " (line)");
  }
  text(x0, y0 - 20, 7, chart.x_label + ".  " + legend);
  y_ = y0 - below;
}

void PdfDocument::blanks(const std::vector<std::string>& labels) {
  constexpr double row = 26, label_width = 130;
  need(row * double(labels.size()) + 10);
  for (const std::string& label : labels) {
    y_ -= row;
    text(page_margin, y_, text_size, label);
    line({{page_margin + label_width, y_ - 2}, {page_margin + 0.75 * content_width, y_ - 2}}, 0.5, "0 0 0");
  }
  y_ -= 10;
}

std::string PdfDocument::bytes() const {
  std::vector<std::string> objects;
  constexpr int first_page = 6;  // after catalogue, page tree and fonts
  std::string kids;
  for (std::size_t p = 0; p < pages_.size(); ++p) kids += fmt::format("{} 0 R ", first_page + 2 * int(p));
  objects.push_back("<< /Type /Catalog /Pages 2 0 R >>");
  objects.push_back(fmt::format("<< /Type /Pages /Kids [{}] /Count {} >>", kids, pages_.size()));
  for (const char* font : {"Helvetica", "Helvetica-Bold", "Courier"})
    objects.push_back(
        fmt::format("<< /Type /Font /Subtype /Type1 /BaseFont /{} /Encoding /WinAnsiEncoding >>", font));
  for (std::size_t p = 0; p < pages_.size(); ++p) {
    objects.push_back(
        fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {} {}] /Contents {} 0 R /Resources << /Font "
                    "<< /F1 3 0 R /F2 4 0 R /F3 5 0 R >> >> >>",
                    paper_width, paper_height, first_page + 2 * int(p) + 1));
    objects.push_back(fmt::format("<< /Length {} >>\nstream\n{}endstream", pages_[p].size(), pages_[p]));
  }
  objects.push_back(fmt::format("<< /Title ({}) /Producer (helicarm) >>", pdf_string(title_)));
  std::string file = "%PDF-1.4\n%\xE2\xE3\xCF\xD3\n", offsets;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    offsets += fmt::format("{:010} 00000 n \n", file.size());
    file += fmt::format("{} 0 obj\n{}\nendobj\n", i + 1, objects[i]);
  }
  const std::size_t table_at = file.size();
  file += fmt::format("xref\n0 {}\n0000000000 65535 f \n{}", objects.size() + 1, offsets);
  file += fmt::format("trailer\n<< /Size {} /Root 1 0 R /Info {} 0 R >>\nstartxref\n{}\n%%EOF\n",
                      objects.size() + 1, objects.size(), table_at);
  return file;
}

}  // namespace helicarm::report
