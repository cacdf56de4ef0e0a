// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace helicarm::report {

/// One value as text, as every output shows it.
struct Cell {
  std::string text = "–";
  bool is_bad = false;  ///< shown in red
  double share = 0;     ///< length of a bar beside the value, of the column's longest: 0 (none) to 1
};

/// `title` with the unit; `definition` says what the values are.
struct Column {
  std::string title, definition;
  bool is_number = false;
};
inline Column words(std::string title, std::string definition) {
  return {std::move(title), std::move(definition), false};
}
inline Column number(std::string title, std::string definition) {
  return {std::move(title), std::move(definition), true};
}

/// Every cell is plain text: the outputs escape it. Each row has a cell per column.
struct Table {
  std::string heading;
  std::vector<Column> columns;
  std::vector<std::vector<Cell>> rows = {};
};

/// A column of a table with a row per `Row`.
template <class Row>
struct ColumnOf {
  Column column;
  std::function<Cell(const Row&)> cell;
};

template <class Row>
Table table_of(std::string heading, const std::vector<ColumnOf<Row>>& columns, const std::vector<Row>& rows) {
  Table table{std::move(heading), {}};
  for (const ColumnOf<Row>& each : columns) table.columns.push_back(each.column);
  for (const Row& row : rows) {
    auto& cells = table.rows.emplace_back();
    for (const ColumnOf<Row>& each : columns) cells.push_back(each.cell(row));
  }
  return table;
}

/// Tables of the same rows as one, with the first one's heading.
Table beside(Table left, const Table& right);

/// Omits each column without a value in any row.
Table without_empty_columns(Table table);

/// Definitions are the headings' tool tips.
std::string html_of(const Table& table);

/// Aligned columns for a terminal, each line indented by two spaces; a bad cell is followed by " !".
std::string text_of(const Table& table);

}  // namespace helicarm::report
