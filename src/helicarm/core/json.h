// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "helicarm/core/failure.h"

namespace helicarm {

/// Keys keep their order.
using Json = nlohmann::ordered_json;

}  // namespace helicarm

/// Instantiated once, in json.cc.
extern template class nlohmann::basic_json<nlohmann::ordered_map>;

namespace helicarm {

/// Parses JSON text. NaN, Infinity and numbers beyond a double are `not_finite`; a duplicate key, nesting
/// deeper than 64, an object of more than 1000 keys and any other syntax error are `bad_json`. `origin` (a
/// file name) begins each message. All external JSON is read by this function.
Expected<Json> parse_json(std::string_view text, const std::string& origin);
Expected<Json> read_json(const std::filesystem::path& path);

/// Indented text. Invalid UTF-8 (possible in file names) is replaced.
std::string to_text(const Json& json);

struct Range {
  double low;
  double high;
};

/// Reads one JSON object strictly: type and range of every field are checked, and a key that is not read is
/// an error. All members throw BadInput; the message names file, field, value and limit.
class JsonReader {
 public:
  JsonReader(const Json& value, std::string where);

  bool has(const char* key) const;  ///< present and not null
  double number(const char* key, Range range);
  std::optional<double> optional_number(const char* key, Range range);
  int integer(const char* key, int low, int high);
  /// Control characters are refused: the text may be printed on a terminal or become part of a file name.
  std::string text(const char* key, std::size_t max_length = 200);
  std::optional<std::string> optional_text(const char* key, std::size_t max_length = 200);
  bool boolean(const char* key, bool fallback);
  std::vector<double> numbers(const char* key, std::size_t count, Range range);
  /// Flattened rows x columns matrix, row major.
  std::vector<double> matrix(const char* key, std::size_t rows, std::size_t columns, Range range);
  /// Nested object (must exist), with its own reader.
  JsonReader object(const char* key);
  /// Elements of an array of objects; an absent array is empty unless `required`.
  std::vector<JsonReader> objects(const char* key, bool required, std::size_t max_count = 10000);
  /// Raw value for a field whose structure the caller checks; null if absent.
  const Json& raw(const char* key);
  /// Index in `names` of the field's value.
  std::size_t choice(const char* key, std::initializer_list<std::string_view> names);

  /// Call last: throws `unknown_key` for a key that was not read.
  void finish() const;

  const std::string& where() const { return where_; }
  [[noreturn]] void refuse(Reason reason, const char* key, const std::string& problem) const;

 private:
  const Json& required(const char* key);
  double checked(const Json& value, const char* key, Range range) const;

  const Json* value_;
  std::string where_;
  std::vector<std::string> asked_;
};

}  // namespace helicarm
