// SPDX-License-Identifier: Apache-2.0
#include "helicarm/report/table.h"

#include <algorithm>

#include <fmt/format.h>

#include "helicarm/report/markup.h"

namespace helicarm::report {
namespace {

bool has_value(const Cell& cell) { return !cell.text.empty() && cell.text != "–"; }

std::string html_of(const Cell& cell) {
  constexpr double longest_rem = 8;
  const std::string bar =
      cell.share > 0
          ? fmt::format("<span class=\"error\" style=\"width:{:.2f}rem\"></span> ", longest_rem * cell.share)
          : std::string();
  return bar + (cell.is_bad ? "<span class=\"bad\">" + escaped(cell.text) + "</span>" : escaped(cell.text));
}

std::string words_of(const Cell& cell) { return cell.is_bad ? cell.text + " !" : cell.text; }

/// Characters of UTF-8 text.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0) != 0x80; }));
}

std::string padded(const std::string& text, std::size_t width, bool to_the_right) {
  const std::string space(width - width_of(text), ' ');
  return to_the_right ? space + text : text + space;
}

}  // namespace

Table beside(Table left, const Table& right) {
  left.columns.insert(left.columns.end(), right.columns.begin(), right.columns.end());
  for (std::size_t i = 0; i < left.rows.size(); ++i)
    left.rows[i].insert(left.rows[i].end(), right.rows.at(i).begin(), right.rows.at(i).end());
  return left;
}

Table without_empty_columns(Table table) {
  for (std::size_t i = table.columns.size(); i-- > 0;) {
    if (std::ranges::any_of(table.rows, [&](const auto& row) { return has_value(row[i]); })) continue;
    table.columns.erase(table.columns.begin() + std::ptrdiff_t(i));
    for (auto& row : table.rows) row.erase(row.begin() + std::ptrdiff_t(i));
  }
  return table;
}

std::string html_of(const Table& table) {
  const auto tag = [&](const char* name, std::size_t column, const std::string& title) {
    return fmt::format("<{}{}{}>", name, table.columns[column].is_number ? " class=\"n\"" : "",
                       title.empty() ? "" : " title=\"" + escaped(title) + "\"");
  };
  std::string html = "<div class=\"scroll\"><table><thead><tr>";
  for (std::size_t i = 0; i < table.columns.size(); ++i)
    html += tag("th", i, table.columns[i].definition) + escaped(table.columns[i].title) + "</th>";
  html += "</tr></thead>\n<tbody>\n";
  for (const auto& row : table.rows) {
    html += "<tr>";
    for (std::size_t i = 0; i < row.size(); ++i) html += tag("td", i, "") + html_of(row[i]) + "</td>";
    html += "</tr>\n";
  }
  return html + "</tbody></table></div>\n";
}

std::string text_of(const Table& table) {
  std::vector<std::vector<std::string>> lines(1);
  for (const Column& column : table.columns) lines[0].push_back(column.title);
  for (const auto& row : table.rows) {
    auto& line = lines.emplace_back();
    for (const Cell& cell : row) line.push_back(words_of(cell));
  }
  std::vector<std::size_t> widths(table.columns.size(), 0);
  for (const auto& line : lines)
    for (std::size_t i = 0; i < line.size(); ++i) widths[i] = std::max(widths[i], width_of(line[i]));
  std::string text;
  for (const auto& line : lines) {
    std::string written;
    for (std::size_t i = 0; i < line.size(); ++i)
      written += "  " + padded(line[i], widths[i], table.columns[i].is_number);
    text += written.substr(0, written.find_last_not_of(' ') + 1) + '\n';
  }
  return text;
}

}  // namespace helicarm::report
