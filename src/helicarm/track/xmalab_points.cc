// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/xmalab_points.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/text.h"

namespace helicarm::track {
namespace {

namespace fs = std::filesystem;

struct XmalabTable {
  std::string origin;
  std::vector<std::string> columns;  ///< of offsets: empty
  std::vector<std::vector<std::string_view>> cells;
  std::string text;  ///< that the cells lie in
};

std::vector<std::string_view> cells_of(std::string_view line) {
  std::vector<std::string_view> cells;
  for (;;) {
    const std::size_t comma = line.find(',');
    cells.push_back(trimmed(line.substr(0, comma)));
    if (comma == line.npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

/// Length of "cam1_offset" at the beginning of a name; 0: there is none.
std::size_t offset_word(std::string_view name) {
  constexpr std::string_view begin = "cam", end = "_offset";
  if (!name.starts_with(begin)) return 0;
  const std::size_t behind = name.find_first_not_of("0123456789", begin.size());
  if (behind == begin.size() || behind == name.npos || !name.substr(behind).starts_with(end)) return 0;
  return behind + end.size();
}

XmalabTable read_table(const fs::path& file) {
  constexpr std::uintmax_t most_table_bytes = std::uintmax_t(256) << 20;
  XmalabTable table;
  table.text = value_or_throw(read_file(file, most_table_bytes));
  table.origin = file.filename().string();
  std::string_view rest = table.text;
  if (rest.starts_with("\xEF\xBB\xBF")) rest.remove_prefix(3);
  while (!rest.empty()) {
    const std::size_t end = rest.find_first_of("\r\n");
    const std::string_view line = rest.substr(0, end);
    rest.remove_prefix(end == rest.npos ? rest.size() : end + 1);
    if (trimmed(line).empty()) continue;
    auto cells = cells_of(line);
    if (!table.columns.empty()) {
      if (cells.size() != table.columns.size())
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: row {}: {} fields, the header has {}", table.origin,
                                   table.cells.size() + 1, cells.size(), table.columns.size()));
      table.cells.push_back(std::move(cells));
      continue;
    }
    // XMALab itself writes the offsets' names without commas between and behind them.
    for (std::string_view cell : cells) {
      bool is_offset = false;
      while (const std::size_t length = offset_word(cell)) {
        table.columns.emplace_back();
        cell.remove_prefix(length);
        is_offset = true;
      }
      if (is_offset && cell.empty()) continue;
      if (holds_control_character(std::string(cell)) || cell.find('"') != cell.npos)
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: header: a quote or a control character", table.origin));
      table.columns.emplace_back(cell);
    }
  }
  return table;
}

std::optional<double> number_of(const XmalabTable& table, std::size_t row, std::size_t column) {
  const std::string_view cell = table.cells[row][column];
  if (cell.empty() || cell == "NaN" || cell == "nan" || cell == "-nan" || cell == "NAN") return std::nullopt;
  double value = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (error != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(value))
    throw BadInput(
        Reason::bad_value,
        fmt::format("{}: row {}: {}: \"{}\" is not a number", table.origin, row + 1, table.columns[column],
                    without_control_characters(std::string(cell.substr(0, 40)))));
  return value;
}

void check_offsets(const XmalabTable& table) {
  for (std::size_t column = 0; column < table.columns.size(); ++column)
    for (std::size_t row = 0; table.columns[column].empty() && row < table.cells.size(); ++row)
      if (number_of(table, row, column).value_or(0) != 0)
        throw BadInput(
            Reason::unsupported,
            fmt::format("{}: row {}: a camera's offset is {}, not 0: export the points without offset "
                        "columns, and state \"frame_offset\" in the case",
                        table.origin, row + 1, table.cells[row][column]));
}

[[noreturn]] void refuse_column(const XmalabTable& table, const std::string& column,
                                const std::string& form) {
  double value = 0;
  const auto [end, error] = std::from_chars(column.data(), column.data() + column.size(), value);
  const bool is_number = column == "NaN" || (error == std::errc{} && end == column.data() + column.size());
  throw BadInput(is_number ? Reason::unsupported : Reason::bad_value,
                 is_number
                     ? fmt::format("{}: has no header: export it with one", table.origin)
                     : fmt::format("{}: header: \"{}\" is not {}", table.origin, column.substr(0, 80), form));
}

/// "jaw1_cam2_X" -> jaw1, 1, 0.
struct Column2d {
  std::string marker;
  std::size_t camera = 0;
  int axis = 0;
};
std::optional<Column2d> column_2d(const std::string& name) {
  const std::size_t at = name.rfind("_cam");
  if (at == name.npos || at == 0 || name.size() < at + 7) return std::nullopt;
  const std::string_view rest = std::string_view(name).substr(at + 4);
  std::size_t camera = 0;
  const auto [end, error] = std::from_chars(rest.begin(), rest.end(), camera);
  const std::string_view axis(end, std::size_t(rest.end() - end));
  if (error != std::errc{} || camera < 1 || (axis != "_X" && axis != "_Y")) return std::nullopt;
  return Column2d{name.substr(0, at), camera - 1, axis == "_X" ? 0 : 1};
}

}  // namespace

Expected<XmalabPoints2d> read_xmalab_points2d(const fs::path& file, std::size_t cameras) {
  return guarded([&] {
    const XmalabTable table = read_table(file);
    XmalabPoints2d read;
    std::vector<std::vector<std::size_t>> columns;  // [marker][2 * camera + axis]
    constexpr std::size_t none = std::size_t(-1);
    for (std::size_t i = 0; i < table.columns.size(); ++i) {
      if (table.columns[i].empty()) continue;
      const auto column = column_2d(table.columns[i]);
      if (!column) refuse_column(table, table.columns[i], "NAME_cam1_X, NAME_cam1_Y, NAME_cam2_X, ...");
      if (column->camera >= cameras)
        throw BadInput(Reason::bad_value, fmt::format("{}: header: \"{}\": the case has {} views",
                                                      table.origin, table.columns[i], cameras));
      auto marker = std::size_t(std::ranges::find(read.markers, column->marker) - read.markers.begin());
      if (marker == read.markers.size()) {
        read.markers.push_back(column->marker);
        columns.emplace_back(2 * cameras, none);
      }
      auto& at = columns[marker][2 * column->camera + std::size_t(column->axis)];
      if (at != none)
        throw BadInput(Reason::name_clash,
                       fmt::format("{}: header: \"{}\" is given twice", table.origin, table.columns[i]));
      at = i;
    }
    if (read.markers.empty())
      throw BadInput(Reason::bad_value, fmt::format("{}: has no column NAME_cam1_X", table.origin));
    for (std::size_t m = 0; m < columns.size(); ++m)
      if (std::ranges::count(columns[m], none) > 0)
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: header: \"{}\" has no X and Y in each of the {} views", table.origin,
                                   read.markers[m], cameras));
    check_offsets(table);
    for (std::size_t row = 0; row < table.cells.size(); ++row) {
      auto& points = read.rows.emplace_back();
      for (const auto& of : columns)
        for (std::size_t k = 0; k < cameras; ++k) {
          const auto x = number_of(table, row, of[2 * k]), y = number_of(table, row, of[2 * k + 1]);
          if (x.has_value() != y.has_value())
            throw BadInput(Reason::bad_value,
                           fmt::format("{}: row {}: {} and {}: one is missing", table.origin, row + 1,
                                       table.columns[of[2 * k]], table.columns[of[2 * k + 1]]));
          points.push_back(x ? std::optional(Eigen::Vector2d(*x, *y)) : std::nullopt);
        }
    }
    return read;
  });
}

Expected<std::optional<std::vector<Eigen::Vector3d>>> read_xmalab_points3d(
    const fs::path& file, const std::vector<std::string>& markers) {
  return guarded([&]() -> std::optional<std::vector<Eigen::Vector3d>> {
    const XmalabTable table = read_table(file);
    const auto find = [&](const std::string& name) {
      return std::size_t(std::ranges::find(table.columns, name) - table.columns.begin());
    };
    if (std::ranges::none_of(table.columns, [](const std::string& name) { return name.ends_with("_Z"); }))
      return std::nullopt;
    std::vector<std::size_t> columns;
    for (const std::string& marker : markers)
      for (const char* axis : {"_X", "_Y", "_Z"}) {
        columns.push_back(find(marker + axis));
        if (columns.back() == table.columns.size())
          throw BadInput(Reason::bad_value,
                         fmt::format("{}: the column \"{}{}\" is missing", table.origin, marker, axis));
      }
    for (std::size_t row = 0; row < table.cells.size(); ++row) {
      std::vector<Eigen::Vector3d> places(markers.size());
      bool is_whole = true;
      for (std::size_t i = 0; i < columns.size(); ++i) {
        const auto value = number_of(table, row, columns[i]);
        is_whole = is_whole && value;
        places[i / 3][Eigen::Index(i % 3)] = value.value_or(0);
      }
      if (is_whole) return places;
    }
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: no row has the places of {}", table.origin, fmt::join(markers, ", ")));
  });
}

}  // namespace helicarm::track
