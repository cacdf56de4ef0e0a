// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "helicarm/report/chart.h"
#include "helicarm/report/table.h"

namespace helicarm::report {

/// A report as PDF without a window system: A4 pages filled from top to bottom, in the fonts that every
/// reader has. Text is UTF-8; characters that these fonts lack become "?". Equal input gives equal bytes.
class PdfDocument {
 public:
  /// `footer` is on each page, with its number.
  PdfDocument(std::string title, std::string footer);

  void heading(std::string_view text, bool is_title = false);
  /// Broken into lines at spaces.
  void paragraph(std::string_view text);
  /// Its headings are repeated on each page; a bad cell is followed by " !".
  void table(const Table& table);
  /// The curves of a chart, three quarters of the page wide.
  void chart(const Chart& chart);
  /// Lines to be filled in by hand, each after its label.
  void blanks(const std::vector<std::string>& labels);

  std::string bytes() const;

 private:
  enum class Font { plain, bold, fixed };
  void need(double height);
  void begin_page();
  void text(double x, double y, double size, std::string_view utf8, Font font = Font::plain);
  void line(const std::vector<std::array<double, 2>>& points, double width, const char* ink,
            bool dashed = false);
  void dot(double x, double y, const char* ink);

  std::string title_, footer_;
  std::vector<std::string> pages_;
  double y_ = 0;  ///< of the next line, from below
};

}  // namespace helicarm::report
