// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace helicarm {

/// Text made safe for HTML and SVG content and attributes: markup is escaped, control characters are
/// replaced.
std::string escaped(std::string_view text);

std::string base64(std::string_view bytes);

/// `digits` after the point, or an en dash where there is no value.
std::string fixed(std::optional<double> value, int digits);

/// An HTML table. Cells are HTML already; a column is of numbers where its heading begins with '#'.
class HtmlTable {
 public:
  explicit HtmlTable(std::vector<std::string> headings) : headings_(std::move(headings)) {}
  void row(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  bool empty() const { return rows_.empty(); }
  std::string html() const;

 private:
  std::vector<std::string> headings_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace helicarm
