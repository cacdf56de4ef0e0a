// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"

namespace helicarm {
namespace {

constexpr std::uintmax_t max_csv_bytes = 64u << 20;

using Fields = std::vector<std::string>;

std::string without_blanks(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == text.npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(" \t\r") - first + 1));
}

/// RFC 4180: the fields of the line at `at`, which is moved behind the line. A quoted field may hold commas,
/// line ends and, doubled, quotes. Blanks around a field are left out. Throws BadInput.
Fields fields_of_line(std::string_view text, std::size_t& at, const std::string& where) {
  Fields fields;
  for (bool more = true; more;) {
    at = std::min(text.find_first_not_of(" \t", at), text.size());
    std::string field;
    if (at < text.size() && text[at] == '"') {
      for (++at;; ++at) {
        const std::size_t quote = text.find('"', at);
        if (quote == text.npos)
          throw BadInput(Reason::truncated, fmt::format("{}: a quoted field does not end", where));
        field.append(text.substr(at, quote - at));
        at = quote + 1;
        if (at == text.size() || text[at] != '"') break;
        field.append(1, '"');
      }
    }
    const std::size_t end = std::min(text.find_first_of(",\r\n", at), text.size());
    const std::string rest = without_blanks(text.substr(at, end - at));
    if (!field.empty() && !rest.empty())
      throw BadInput(Reason::bad_value, fmt::format("{}: text behind the quoted field \"{}\"", where,
                                                    without_control_characters(field.substr(0, 40))));
    fields.push_back(field + rest);
    more = end < text.size() && text[end] == ',';
    at = std::min(end + (text.substr(end).starts_with("\r\n") ? 2 : 1), text.size());
  }
  return fields;
}

bool is_utf_8(const std::string& text) {
  try {
    return !Json(text).dump().empty();
  } catch (const Json::type_error&) {
    return false;
  }
}

/// Throws BadInput for what would be printed on a terminal or become part of a file name.
void check_text(const Fields& fields, const std::string& where) {
  if (std::ranges::any_of(fields, holds_control_character))
    throw BadInput(Reason::bad_value, fmt::format("{}: contains a control character", where));
  if (!std::ranges::all_of(fields, is_utf_8))
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: is not UTF-8 (Latin-1?): save the file as UTF-8", where));
}

/// Spreadsheets of countries with a decimal comma separate by semicolons.
void check_separator(const Fields& header, const std::string& origin) {
  for (const char separator : {';', '\t'})
    if (header.size() == 1 && header[0].find(separator) != std::string::npos)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: the columns are separated by {}: separate them by commas, and write "
                                 "numbers with a point",
                                 origin, separator == ';' ? "semicolons" : "tabs"));
}

/// Lines without the empty ones and those that begin with #.
std::vector<Fields> lines_of(std::string_view text, const std::string& origin) {
  std::vector<Fields> lines;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find_first_of("\r\n", at), text.size());
    if (text[at] == '#' || without_blanks(text.substr(at, end - at)).empty()) {
      at = std::min(end + 1, text.size());
      continue;
    }
    const std::string where =
        lines.empty() ? origin + ": header" : fmt::format("{}: row {}", origin, lines.size());
    Fields fields = fields_of_line(text, at, where);
    if (lines.empty()) check_separator(fields, origin);
    check_text(fields, where);
    if (!lines.empty() && fields.size() != lines[0].size())
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: {} fields, the header has {}", where, fields.size(), lines[0].size()));
    lines.push_back(std::move(fields));
  }
  return lines;
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
  const bool plus = field.size() > 1 && field[0] == '+' && field[1] != '-';  // from_chars reads no plus
  const auto [end, error] = std::from_chars(field.data() + plus, field.data() + field.size(), value);
  if (error == std::errc::result_out_of_range || (error == std::errc() && !std::isfinite(value)))
    throw BadInput(Reason::not_finite,
                   fmt::format("{}: row {}: {}: \"{}\" is not finite", origin_, row + 1, column, field));
  if (error != std::errc() || end != field.data() + field.size())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: row {}: {}: \"{}\" is not a number{}", origin_, row + 1, column, field,
                               field.find(',') != field.npos ? ": write it with a point" : ""));
  return value;
}

std::optional<double> CsvTable::optional_number(std::size_t row, const std::string& column) const {
  if (!has(column) || text(row, column).empty()) return std::nullopt;
  return number(row, column);
}

Expected<CsvTable> read_csv(const std::filesystem::path& path, std::initializer_list<const char*> required,
                            std::initializer_list<const char*> optional) {
  const auto bytes = read_file(path, max_csv_bytes);
  if (!bytes) return tl::unexpected<Failure>(bytes.error());
  CsvTable table;
  table.origin_ = path.filename().string();
  if (is_utf_16(*bytes))
    return fail(Reason::bad_value, fmt::format("{}: is UTF-16: save it as CSV in UTF-8", table.origin_));
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  const std::string_view text = *bytes;
  auto lines = guarded([&] {
    return lines_of(text.substr(text.starts_with(byte_order_mark) ? byte_order_mark.size() : 0),
                    table.origin_);
  });
  if (!lines) return tl::unexpected<Failure>(lines.error());
  if (!lines->empty()) {
    table.columns_ = std::move(lines->front());
    table.cells_.assign(std::move_iterator(lines->begin() + 1), std::move_iterator(lines->end()));
  }
  for (const char* column : required)
    if (!table.has(column))
      return fail(Reason::bad_value, fmt::format("{}: the column \"{}\" is missing (given: {})",
                                                 table.origin_, column, fmt::join(table.columns_, ", ")));
  const auto known = [&](const std::string& column) {
    const auto same = [&](const char* name) { return column == name; };
    return std::any_of(required.begin(), required.end(), same) ||
           std::any_of(optional.begin(), optional.end(), same);
  };
  for (const std::string& column : table.columns_)
    if (!known(column))
      return fail(
          Reason::unknown_key,
          fmt::format("{}: the column \"{}\" is unknown; remove it (known: {}{}{})", table.origin_, column,
                      fmt::join(required, ", "), optional.size() > 0 ? ", " : "", fmt::join(optional, ", ")));
  return table;
}

std::string csv_field(const std::string& text) {
  const bool is_plain = text.find_first_of(",\"\r\n") == std::string::npos && !text.starts_with('#') &&
                        !text.starts_with(' ') && !text.ends_with(' ');
  if (is_plain) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

}  // namespace helicarm
