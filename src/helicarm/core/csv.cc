// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/text.h"

namespace helicarm {
namespace {

constexpr std::uintmax_t max_csv_bytes = 64u << 20;

std::string trimmed(const std::string& text) {
  const auto first = text.find_first_not_of(" \t\r\"");
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r\"") - first + 1);
}

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> fields;
  std::size_t start = 0;
  while (true) {
    const std::size_t comma = line.find(',', start);
    fields.push_back(trimmed(line.substr(start, comma - start)));
    if (comma == std::string::npos) return fields;
    start = comma + 1;
  }
}

std::size_t index_of(const std::vector<std::string>& columns, const std::string& column) {
  return static_cast<std::size_t>(std::find(columns.begin(), columns.end(), column) - columns.begin());
}

}  // namespace

bool CsvTable::has(const std::string& column) const { return index_of(columns_, column) < columns_.size(); }

const std::string& CsvTable::text(std::size_t row, const std::string& column) const {
  return cells_.at(row).at(index_of(columns_, column));
}

double CsvTable::number(std::size_t row, const std::string& column) const {
  const std::string& field = text(row, column);
  double value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error == std::errc::result_out_of_range || (error == std::errc() && !std::isfinite(value)))
    throw BadInput(Reason::not_finite,
                   fmt::format("{}: row {}: {}: \"{}\" is not finite", origin_, row + 1, column, field));
  if (error != std::errc() || end != field.data() + field.size())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: row {}: {}: \"{}\" is not a number", origin_, row + 1, column, field));
  return value;
}

std::optional<double> CsvTable::optional_number(std::size_t row, const std::string& column) const {
  if (!has(column) || text(row, column).empty()) return std::nullopt;
  return number(row, column);
}

Expected<CsvTable> read_csv(const std::filesystem::path& path, std::initializer_list<const char*> required,
                            std::initializer_list<const char*> optional) {
  auto bytes = read_file(path, max_csv_bytes);
  if (!bytes) return tl::unexpected<Failure>(bytes.error());
  CsvTable table;
  table.origin_ = path.filename().string();
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  if (bytes->starts_with(byte_order_mark)) bytes->erase(0, byte_order_mark.size());
  std::istringstream lines(*bytes);
  std::string line;
  while (std::getline(lines, line)) {
    if (trimmed(line).empty() || line[0] == '#') continue;
    auto fields = split(line);
    if (std::ranges::any_of(fields, holds_control_character))
      return fail(Reason::bad_value,
                  fmt::format("{}: row {}: contains a control character", table.origin_, table.rows() + 1));
    if (table.columns_.empty()) {
      table.columns_ = std::move(fields);
      continue;
    }
    if (fields.size() != table.columns_.size())
      return fail(Reason::bad_value, fmt::format("{}: row {}: {} fields, the header has {}", table.origin_,
                                                 table.rows() + 1, fields.size(), table.columns_.size()));
    table.cells_.push_back(std::move(fields));
  }
  for (const char* column : required)
    if (!table.has(column))
      return fail(Reason::bad_value, fmt::format("{}: the column \"{}\" is missing", table.origin_, column));
  const auto known = [&](const std::string& column) {
    const auto same = [&](const char* name) { return column == name; };
    return std::any_of(required.begin(), required.end(), same) ||
           std::any_of(optional.begin(), optional.end(), same);
  };
  for (const std::string& column : table.columns_)
    if (!known(column))
      return fail(Reason::unknown_key,
                  fmt::format("{}: the column \"{}\" is unknown; remove it", table.origin_, column));
  return table;
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

}  // namespace helicarm
