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
constexpr std::size_t max_depth = 64;
/// nlohmann::ordered_map searches keys linearly: their number must be bounded.
constexpr std::size_t max_keys = 1000;

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

/// Insertions, deletions, changes and exchanges of neighbours that make one word of the other.
std::size_t edits_between(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> edits(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t k = 0; k <= b.size(); ++k) {
      if (i == 0 || k == 0) {
        edits[i][k] = i + k;
        continue;
      }
      edits[i][k] = std::min(
          {edits[i - 1][k] + 1, edits[i][k - 1] + 1, edits[i - 1][k - 1] + (a[i - 1] == b[k - 1] ? 0 : 1)});
      if (i > 1 && k > 1 && a[i - 1] == b[k - 2] && a[i - 2] == b[k - 1])
        edits[i][k] = std::min(edits[i][k], edits[i - 2][k - 2] + 1);
    }
  return edits[a.size()][b.size()];
}

/// What to say of a key that may be a misspelt `key`; nothing where none is like it.
std::string misspelling_of(std::string_view key, const Json& object, const std::vector<std::string>& known) {
  constexpr std::size_t shortest = 5, longest = 100;  // of short names, others may be as near
  if (key.size() < shortest) return {};
  for (const auto& [name, value] : object.items())
    if (name.size() <= longest && std::ranges::find(known, name) == known.end() &&
        edits_between(key, name) <= std::min<std::size_t>(2, key.size() / 4))
      return fmt::format(" (there is {}: misspelt?)", shorten(name));
  return {};
}

/// SAX pass without building values: bounds nesting and keys before memory grows with them.
class StructureCheck : public nlohmann::json_sax<Json> {
 public:
  StructureCheck(std::string_view text, const std::string& origin) : text_(text), origin_(origin) {}

  const Failure& failure() const { return failure_; }

  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool start_object(std::size_t) override { return deeper(); }
  bool end_object() override { return shallower(); }
  bool start_array(std::size_t) override { return deeper(); }
  bool end_array() override { return shallower(); }

  bool key(string_t& name) override {
    if (!keys_.back().insert(name).second)
      return refuse(Reason::bad_json, fmt::format("key {} is given twice", shorten(name)));
    if (keys_.back().size() > max_keys)
      return refuse(Reason::bad_json, fmt::format("an object has more than {} keys", max_keys));
    return true;
  }

  bool parse_error(std::size_t position, const std::string&,
                   const nlohmann::json::exception& error) override {
    constexpr int out_of_range = 406;
    if (error.id == out_of_range)
      return refuse(Reason::not_finite, fmt::format("a number is beyond the range of a double at {}",
                                                    place(std::min(position, text_.size()))));
    const std::size_t at = std::min(position, text_.size());
    for (std::size_t start = at > 10 ? at - 10 : 0; start < at; ++start)
      if (names_non_finite(text_.substr(start)))
        return refuse(Reason::not_finite, fmt::format("a number is not finite at {}", place(start + 1)));
    if (std::string_view(error.what()).find("ill-formed UTF-8") != std::string_view::npos)
      return refuse(Reason::bad_json,
                    fmt::format("not UTF-8 at {}: the file has another encoding (Latin-1?), save it as UTF-8",
                                place(position)));
    return refuse(Reason::bad_json,
                  fmt::format("not valid JSON at {}{}", place(position), comma_before(position)));
  }

 private:
  bool refuse(Reason reason, const std::string& problem) {
    failure_ = {reason, fmt::format("{}: {}", origin_, problem), {}, {}};
    return false;
  }
  /// What to say of a comma behind the last entry, where that is the fault at the byte, counted from 1.
  std::string comma_before(std::size_t byte) const {
    if (byte < 2 || byte > text_.size() || (text_[byte - 1] != '}' && text_[byte - 1] != ']')) return {};
    const std::size_t before = text_.find_last_not_of(" \t\r\n", byte - 2);
    if (before == text_.npos || text_[before] != ',') return {};
    return fmt::format(": remove the comma before \"{}\"", text_[byte - 1]);
  }
  /// Line and column of a byte, counted from 1.
  std::string place(std::size_t byte) const {
    const std::string_view before = text_.substr(0, std::min(byte > 0 ? byte - 1 : 0, text_.size()));
    const std::size_t line_start = before.rfind('\n') + 1;  // 0 on the first line
    return fmt::format("line {}, column {}", std::ranges::count(before, '\n') + 1,
                       before.size() - line_start + 1);
  }
  bool deeper() {
    if (keys_.size() == max_depth)
      return refuse(Reason::bad_json, fmt::format("nested deeper than {}", max_depth));
    keys_.emplace_back();
    return true;
  }
  bool shallower() {
    keys_.pop_back();
    return true;
  }

  std::string_view text_;
  const std::string& origin_;
  std::vector<std::set<std::string>> keys_;  ///< one set per enclosing object; an array's is empty
  Failure failure_{Reason::bad_json, origin_, {}, {}};
};

}  // namespace

Expected<Json> parse_json(std::string_view text, const std::string& origin) {
  if (is_utf_16(text)) return fail(Reason::bad_json, fmt::format("{}: is UTF-16: save it as UTF-8", origin));
  StructureCheck check(text, origin);
  if (!Json::sax_parse(text.begin(), text.end(), &check)) return tl::unexpected<Failure>(check.failure());
  return Json::parse(text.begin(), text.end());
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
  throw BadInput(reason, fmt::format("{}: \"{}\": {}{}", where_, key, problem,
                                     value_->contains(key) ? "" : misspelling_of(key, *value_, asked_)));
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
    throw BadInput(
        {Reason::bad_value,
         fmt::format("{}: \"{}\": {} is outside {} to {}", where_, key, number, range.low, range.high),
         {},
         {{"value", number}, {"limit", number < range.low ? range.low : range.high}}});
  return number;
}

double JsonReader::number(const char* key, Range range) {
  if (!has(key))
    refuse(Reason::bad_value, key,
           fmt::format("is missing: write a number from {} to {}", range.low, range.high));
  return checked(required(key), key, range);
}

std::optional<double> JsonReader::optional_number(const char* key, Range range) {
  const Json& value = raw(key);
  if (value.is_null()) return std::nullopt;
  return checked(value, key, range);
}

int JsonReader::integer(const char* key, int low, int high) {
  if (!has(key))
    refuse(Reason::bad_value, key, fmt::format("is missing: write a whole number from {} to {}", low, high));
  const double value = checked(required(key), key, {double(low), double(high)});
  if (value != std::floor(value))
    refuse(Reason::bad_value, key, fmt::format("{} is not a whole number", value));
  return static_cast<int>(value);
}

std::string JsonReader::text(const char* key, std::size_t max_length) {
  if (!has(key)) refuse(Reason::bad_value, key, fmt::format("is missing: write \"{}\": \"...\"", key));
  const Json& value = required(key);
  if (!value.is_string()) refuse(Reason::bad_value, key, fmt::format("{} is not a text", shorten(value)));
  auto text = value.get<std::string>();
  if (text.size() > max_length)
    refuse(Reason::bad_value, key, fmt::format("{} characters, limit {}", text.size(), max_length));
  if (holds_control_character(text))
    refuse(Reason::bad_value, key, fmt::format("{} contains a control character", shorten(value)));
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
  if (!has(key)) refuse(Reason::bad_value, key, fmt::format("is missing: write a list of {} numbers", count));
  const Json& value = required(key);
  if (!value.is_array() || value.size() != count)
    refuse(Reason::bad_value, key, fmt::format("must be {} numbers, is {}", count, shorten(value)));
  std::vector<double> numbers;
  for (const Json& element : value) numbers.push_back(checked(element, key, range));
  return numbers;
}

std::vector<double> JsonReader::matrix(const char* key, std::size_t rows, std::size_t columns, Range range) {
  if (!has(key))
    refuse(Reason::bad_value, key, fmt::format("is missing: write {} rows of {} numbers", rows, columns));
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

JsonReader JsonReader::object(const char* key) {
  if (!has(key)) refuse(Reason::bad_value, key, fmt::format("is missing: write \"{}\": {{...}}", key));
  return {required(key), fmt::format("{}: {}", where_, key)};
}

std::vector<JsonReader> JsonReader::objects(const char* key, bool required_here, std::size_t max_count) {
  if (required_here && !has(key))
    refuse(Reason::bad_value, key, fmt::format("is missing: write \"{}\": [{{...}}, ...]", key));
  const Json& value = raw(key);
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
  if (!has(key))
    refuse(Reason::bad_value, key,
           fmt::format("is missing: write \"{}\": \"{}\"", key, fmt::join(names, "\" or \"")));
  const std::string value = text(key);
  const auto found = std::find(names.begin(), names.end(), value);
  if (found == names.end())
    refuse(Reason::bad_value, key, fmt::format("\"{}\" must be one of: {}", value, fmt::join(names, ", ")));
  return static_cast<std::size_t>(found - names.begin());
}

void JsonReader::finish() const {
  for (const auto& [key, value] : value_->items())
    if (std::find(asked_.begin(), asked_.end(), key) == asked_.end())
      throw BadInput(Reason::unknown_key, fmt::format("{}: {} is not a known key (known: {})", where_,
                                                      shorten(key), fmt::join(asked_, ", ")));
}

}  // namespace helicarm
