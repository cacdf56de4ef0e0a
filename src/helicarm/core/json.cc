// SPDX-License-Identifier: Apache-2.0
#include "helicarm/core/json.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/text.h"

template class nlohmann::basic_json<nlohmann::ordered_map>;

namespace helicarm {
namespace {

constexpr std::uintmax_t max_json_bytes = 64u << 20;
constexpr int max_depth = 64;

bool names_non_finite(std::string_view rest) {
  for (std::string_view word : {"NaN", "nan", "Infinity", "inf", "-NaN", "-nan", "-Infinity", "-inf"})
    if (rest.starts_with(word)) return true;
  return false;
}

std::string shorten(const Json& value) {
  std::string text = value.dump(-1, ' ', true, Json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

}  // namespace

Expected<Json> parse_json(std::string_view text, const std::string& origin) {
  std::vector<std::set<std::string>> keys;
  std::string twice;
  bool too_deep = false;
  const auto watch = [&](int depth, Json::parse_event_t event, Json& parsed) {
    if (depth > max_depth) {
      too_deep = true;
      throw BadInput(Reason::bad_json, fmt::format("{}: nested deeper than {}", origin, max_depth));
    }
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.back().insert(parsed.get<std::string>()).second)
      twice = parsed.get<std::string>();
    return true;
  };
  try {
    Json value = Json::parse(text.begin(), text.end(), watch);
    if (!twice.empty())
      return fail(Reason::bad_json, fmt::format("{}: key {} is given twice", origin, shorten(twice)));
    return value;
  } catch (const BadInput& bad) {
    return tl::unexpected<Failure>(bad.failure());
  } catch (const Json::parse_error& error) {
    std::size_t at = std::min<std::size_t>(error.byte, text.size());
    for (std::size_t start = at > 10 ? at - 10 : 0; start < at; ++start)
      if (names_non_finite(text.substr(start)))
        return fail(Reason::not_finite,
                    fmt::format("{}: a number is not finite (byte {})", origin, start + 1));
    return fail(Reason::bad_json, fmt::format("{}: not valid JSON at byte {}", origin, error.byte));
  } catch (const Json::out_of_range& error) {
    return fail(Reason::not_finite, fmt::format("{}: a number is beyond the range of a double", origin));
  }
}

Expected<Json> read_json(const std::filesystem::path& path) {
  auto text = read_file(path, max_json_bytes);
  if (!text) return tl::unexpected<Failure>(text.error());
  return parse_json(*text, path.filename().string());
}

std::string to_text(const Json& json) { return json.dump(2, ' ', false, Json::error_handler_t::replace); }

JsonReader::JsonReader(const Json& value, std::string where) : value_(&value), where_(std::move(where)) {
  if (!value.is_object())
    throw BadInput(Reason::bad_json, fmt::format("{}: is {}, must be an object", where_, value.type_name()));
}

void JsonReader::refuse(Reason reason, const char* key, const std::string& problem) const {
  throw BadInput(reason, fmt::format("{}: \"{}\": {}", where_, key, problem));
}

bool JsonReader::has(const char* key) const {
  const auto found = value_->find(key);
  return found != value_->end() && !found->is_null();
}

const Json& JsonReader::raw(const char* key) {
  static const Json null;
  if (std::find(asked_.begin(), asked_.end(), key) == asked_.end()) asked_.emplace_back(key);
  const auto found = value_->find(key);
  return found == value_->end() ? null : *found;
}

const Json& JsonReader::required(const char* key) {
  const Json& value = raw(key);
  if (value.is_null()) refuse(Reason::bad_value, key, "is missing");
  return value;
}

double JsonReader::checked(const Json& value, const char* key, Range range) const {
  if (!value.is_number()) refuse(Reason::bad_value, key, fmt::format("{} is not a number", shorten(value)));
  const double number = value.get<double>();
  if (!std::isfinite(number)) refuse(Reason::not_finite, key, "is not finite");
  if (number < range.low || number > range.high)
    refuse(Reason::bad_value, key, fmt::format("{} is outside {} to {}", number, range.low, range.high));
  return number;
}

double JsonReader::number(const char* key, Range range) { return checked(required(key), key, range); }

std::optional<double> JsonReader::optional_number(const char* key, Range range) {
  const Json& value = raw(key);
  if (value.is_null()) return std::nullopt;
  return checked(value, key, range);
}

int JsonReader::integer(const char* key, int low, int high) {
  const double value = checked(required(key), key, {double(low), double(high)});
  if (value != std::floor(value))
    refuse(Reason::bad_value, key, fmt::format("{} is not a whole number", value));
  return static_cast<int>(value);
}

std::string JsonReader::text(const char* key, std::size_t max_length) {
  const Json& value = required(key);
  if (!value.is_string()) refuse(Reason::bad_value, key, fmt::format("{} is not a text", shorten(value)));
  auto text = value.get<std::string>();
  if (text.size() > max_length)
    refuse(Reason::bad_value, key, fmt::format("{} characters, limit {}", text.size(), max_length));
  if (holds_control_character(text))
    refuse(Reason::bad_value, key, fmt::format("{} holds a control character", shorten(value)));
  return text;
}

std::optional<std::string> JsonReader::optional_text(const char* key, std::size_t max_length) {
  if (!has(key)) {
    raw(key);
    return std::nullopt;
  }
  return text(key, max_length);
}

bool JsonReader::boolean(const char* key, bool fallback) {
  const Json& value = raw(key);
  if (value.is_null()) return fallback;
  if (!value.is_boolean())
    refuse(Reason::bad_value, key, fmt::format("{} is not true or false", shorten(value)));
  return value.get<bool>();
}

std::vector<double> JsonReader::numbers(const char* key, std::size_t count, Range range) {
  const Json& value = required(key);
  if (!value.is_array() || value.size() != count)
    refuse(Reason::bad_value, key, fmt::format("must be {} numbers, is {}", count, shorten(value)));
  std::vector<double> numbers;
  for (const Json& element : value) numbers.push_back(checked(element, key, range));
  return numbers;
}

std::vector<double> JsonReader::matrix(const char* key, std::size_t rows, std::size_t columns, Range range) {
  const Json& value = required(key);
  std::vector<double> numbers;
  if (value.is_array() && value.size() == rows)
    for (const Json& row : value)
      if (row.is_array() && row.size() == columns)
        for (const Json& element : row) numbers.push_back(checked(element, key, range));
  if (numbers.size() != rows * columns)
    refuse(Reason::bad_value, key, fmt::format("must be {} rows of {} numbers", rows, columns));
  return numbers;
}

JsonReader JsonReader::object(const char* key) { return {required(key), fmt::format("{}: {}", where_, key)}; }

std::vector<JsonReader> JsonReader::objects(const char* key, bool required_here, std::size_t max_count) {
  const Json& value = required_here ? required(key) : raw(key);
  std::vector<JsonReader> readers;
  if (value.is_null()) return readers;
  if (!value.is_array()) refuse(Reason::bad_value, key, "must be a list");
  if (value.size() > max_count)
    refuse(Reason::bad_value, key, fmt::format("{} entries, limit {}", value.size(), max_count));
  for (std::size_t i = 0; i < value.size(); ++i)
    readers.emplace_back(value[i], fmt::format("{}: {}[{}]", where_, key, i));
  return readers;
}

std::size_t JsonReader::choice(const char* key, std::initializer_list<std::string_view> names) {
  const std::string value = text(key);
  const auto found = std::find(names.begin(), names.end(), value);
  if (found == names.end())
    refuse(Reason::bad_value, key, fmt::format("\"{}\" is none of: {}", value, fmt::join(names, ", ")));
  return static_cast<std::size_t>(found - names.begin());
}

void JsonReader::finish() const {
  for (const auto& [key, value] : value_->items())
    if (std::find(asked_.begin(), asked_.end(), key) == asked_.end())
      throw BadInput(Reason::unknown_key, fmt::format("{}: {} is not a known key (known: {})", where_,
                                                      shorten(key), fmt::join(asked_, ", ")));
}

}  // namespace helicarm
