// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <concepts>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/files.h"
#include "helicarm/core/json.h"

/// One description of a JSON object gives its reader, its writer and its schema:
///
///     template <class Codec, class Line>
///     void describe(Codec& codec, Line& line) {
///       codec.text("name", line.name, "of the line, unique");
///       codec.number("length_mm", line.length_mm, {0, 500}, "from end to end");
///     }
///
/// `FromJson` sets the values, `ToJson` takes them, `ToSchema` needs only what they are. An unset optional
/// value is not written. Each key has a help text, in the words of docs/formats.md.
namespace helicarm {

struct TextLimits {
  std::size_t least = 1, most = 100;  ///< characters
};

/// Reads; throws BadInput as JsonReader. The caller ends with `reader.finish()`.
class FromJson {
 public:
  explicit FromJson(JsonReader& reader) : reader_(&reader) {}

  /// Whether a value that is only written under a condition is described: always, but in a writer.
  static bool wants(bool) { return true; }
  /// What is only checked when read: `work(reader)`.
  template <class Work>
  void check(Work&& work) {
    work(*reader_);
  }
  /// Keys of one form of the object, which is told by whether `key` is given.
  template <class Work>
  void form(const char* key, bool with_key, bool, Work&& work) {
    if (reader_->has(key) == with_key) work();
  }

  void text(const char* key, std::string& value, const char*, TextLimits limits = {}) {
    value = reader_->text(key, limits.most);
    if (value.size() < limits.least) reader_->refuse(Reason::bad_value, key, "is empty");
  }
  void text(const char* key, std::optional<std::string>& value, const char*, TextLimits limits = {}) {
    value = reader_->optional_text(key, limits.most);
  }
  void text_or_default(const char* key, std::string& value, const char*, TextLimits limits) {
    value = reader_->optional_text(key, limits.most).value_or(value);
  }
  void number(const char* key, double& value, Range range, const char*) {
    value = reader_->number(key, range);
  }
  void number(const char* key, std::optional<double>& value, Range range, const char*) {
    value = reader_->optional_number(key, range);
  }
  /// Keeps the default where the key is absent.
  void number_or_default(const char* key, double& value, Range range, const char*) {
    value = reader_->optional_number(key, range).value_or(value);
  }
  void integer(const char* key, std::optional<int>& value, int low, int high, const char*) {
    if (!reader_->raw(key).is_null()) value = reader_->integer(key, low, high);
  }
  template <std::integral Integer>
  void integer(const char* key, Integer& value, int low, int high, const char*) {
    value = static_cast<Integer>(reader_->integer(key, low, high));
  }
  void boolean(const char* key, std::optional<bool>& value, const char*) {
    if (!reader_->raw(key).is_null()) value = reader_->boolean(key, false);
  }
  /// A word for each enumerator, in order. Keeps the default where the key is absent.
  template <class Enum, std::size_t n>
  void choice(const char* key, Enum& value, const std::array<std::string_view, n>& words, const char*) {
    if (!reader_->raw(key).is_null()) value = static_cast<Enum>(index_among(key, words));
  }
  template <class Enum, std::size_t n>
  void choice(const char* key, std::optional<Enum>& value, const std::array<std::string_view, n>& words,
              const char*) {
    if (!reader_->raw(key).is_null()) value = static_cast<Enum>(index_among(key, words));
  }
  template <class Enum, std::size_t n>
  void required_choice(const char* key, Enum& value, const std::array<std::string_view, n>& words,
                       const char*) {
    if (reader_->raw(key).is_null())
      reader_->refuse(Reason::bad_value, key,
                      fmt::format("is missing: write \"{}\": \"{}\"", key, fmt::join(words, "\" or \"")));
    value = static_cast<Enum>(index_among(key, words));
  }
  /// Eigen's vectors and matrices of fixed size.
  template <class Vector>
  void vector(const char* key, Vector& value, Range range, const char*) {
    value = Vector(reader_->numbers(key, std::size_t(Vector::SizeAtCompileTime), range).data());
  }
  template <class Vector>
  void vector(const char* key, std::optional<Vector>& value, Range range, const char* help) {
    if (!reader_->raw(key).is_null()) vector(key, value.emplace(), range, help);
  }
  template <class Matrix>
  void matrix(const char* key, Matrix& value, Range range, const char*) {
    const auto rows = reader_->matrix(key, std::size_t(Matrix::RowsAtCompileTime),
                                      std::size_t(Matrix::ColsAtCompileTime), range);
    value = Matrix(rows.data()).transpose();
  }
  /// 1 to `most` numbers; an absent list is empty.
  void numbers(const char* key, std::vector<double>& values, std::size_t most, Range range, const char*) {
    const Json& list = reader_->raw(key);
    if (list.is_null()) return;
    if (!list.is_array() || list.empty() || list.size() > most)
      reader_->refuse(Reason::bad_value, key, fmt::format("is not a list of 1 to {} numbers", most));
    values = reader_->numbers(key, list.size(), range);
  }
  /// A file inside the folder.
  void file(const char* key, std::filesystem::path& path, const std::filesystem::path& folder, const char*) {
    path = inside(key, reader_->text(key, most_path), folder);
  }
  void file(const char* key, std::optional<std::filesystem::path>& path, const std::filesystem::path& folder,
            const char*) {
    if (const auto name = reader_->optional_text(key, most_path)) path = inside(key, *name, folder);
  }
  template <class T, class Describe>
  void object(const char* key, T& value, const char*, Describe&& describe) {
    if (reader_->raw(key).is_null()) return;
    if constexpr (requires { value.emplace(); }) {
      read_object(key, value.emplace(), describe);
    } else {
      read_object(key, value, describe);
    }
  }
  template <class T, class Describe>
  void required_object(const char* key, T& value, const char*, Describe&& describe) {
    read_object(key, value, describe);
  }
  /// At most `most`; an absent list is empty unless `required`.
  template <class T, class Describe>
  void list(const char* key, std::vector<T>& values, bool required, std::size_t most, const char*,
            Describe&& describe) {
    for (JsonReader& entry : reader_->objects(key, required, most)) {
      FromJson codec(entry);
      T value{};
      describe(codec, value);
      entry.finish();
      values.push_back(std::move(value));
    }
  }
  /// A value with a reader and a writer of its own: `read(reader)`, `write() -> std::optional<Json>`.
  template <class Read, class Write>
  void custom(const char*, bool, const Json&, const char*, Read&& read, Write&&) {
    read(*reader_);
  }

 private:
  static constexpr std::size_t most_path = 1000;

  std::size_t index_among(const char* key, std::span<const std::string_view> words) const {
    const std::string word = reader_->text(key);
    for (std::size_t i = 0; i < words.size(); ++i)
      if (words[i] == word) return i;
    reader_->refuse(Reason::bad_value, key,
                    fmt::format("\"{}\" must be one of: {}", word, fmt::join(words, ", ")));
  }
  std::filesystem::path inside(const char* key, const std::string& name,
                               const std::filesystem::path& folder) const {
    const auto path = path_inside(folder, name);
    if (!path) reader_->refuse(path.error().reason, key, path.error().message);
    return *path;
  }
  template <class T, class Describe>
  void read_object(const char* key, T& value, Describe&& describe) {
    JsonReader reader = reader_->object(key);
    FromJson codec(reader);
    describe(codec, value);
    reader.finish();
  }

  JsonReader* reader_;
};

/// Writes into `json`, in the order of the description.
class ToJson {
 public:
  enum class Unset { left_out, null };

  explicit ToJson(Unset unset = Unset::left_out) : unset_(unset) {}

  Json json = Json::object();

  static bool wants(bool needed) { return needed; }
  template <class Work>
  void check(Work&&) {}
  template <class Work>
  void form(const char*, bool, bool holds, Work&& work) {
    if (holds) work();
  }

  void text(const char* key, const std::string& value, const char*, TextLimits = {}) { json[key] = value; }
  void text(const char* key, const std::optional<std::string>& value, const char*, TextLimits = {}) {
    put(key, value);
  }
  void text_or_default(const char* key, const std::string& value, const char*, TextLimits) {
    json[key] = value;
  }
  void number(const char* key, double value, Range, const char*) { json[key] = value; }
  void number(const char* key, const std::optional<double>& value, Range, const char*) { put(key, value); }
  void number_or_default(const char* key, double value, Range, const char*) { json[key] = value; }
  void integer(const char* key, const std::optional<int>& value, int, int, const char*) { put(key, value); }
  template <std::integral Integer>
  void integer(const char* key, Integer value, int, int, const char*) {
    json[key] = value;
  }
  void boolean(const char* key, const std::optional<bool>& value, const char*) { put(key, value); }
  template <class Enum, std::size_t n>
  void choice(const char* key, Enum value, const std::array<std::string_view, n>& words, const char*) {
    json[key] = words[std::size_t(value)];
  }
  template <class Enum, std::size_t n>
  void choice(const char* key, const std::optional<Enum>& value, const std::array<std::string_view, n>& words,
              const char*) {
    if (value) json[key] = words[std::size_t(*value)];
  }
  template <class Enum, std::size_t n>
  void required_choice(const char* key, Enum value, const std::array<std::string_view, n>& words,
                       const char* help) {
    choice(key, value, words, help);
  }
  template <class Vector>
  void vector(const char* key, const Vector& value, Range, const char*) {
    json[key] = std::vector<double>(value.begin(), value.end());
  }
  template <class Vector>
  void vector(const char* key, const std::optional<Vector>& value, Range range, const char* help) {
    if (value) vector(key, *value, range, help);
  }
  template <class Matrix>
  void matrix(const char* key, const Matrix& value, Range, const char*) {
    Json rows = Json::array();
    for (const auto& row : value.rowwise()) rows.push_back(std::vector<double>(row.begin(), row.end()));
    json[key] = std::move(rows);
  }
  void numbers(const char* key, const std::vector<double>& values, std::size_t, Range, const char*) {
    if (!values.empty()) json[key] = values;
  }
  void file(const char* key, const std::filesystem::path& path, const std::filesystem::path& folder,
            const char*) {
    json[key] = path.lexically_relative(folder).generic_string();
  }
  void file(const char* key, const std::optional<std::filesystem::path>& path,
            const std::filesystem::path& folder, const char* help) {
    if (path) file(key, *path, folder, help);
  }
  template <class T, class Describe>
  void object(const char* key, const T& value, const char*, Describe&& describe) {
    if constexpr (requires { value.has_value(); }) {
      if (value)
        json[key] = written(*value, describe);
      else if (unset_ == Unset::null)
        json[key] = nullptr;
    } else {
      json[key] = written(value, describe);
    }
  }
  template <class T, class Describe>
  void required_object(const char* key, const T& value, const char*, Describe&& describe) {
    json[key] = written(value, describe);
  }
  template <class T, class Describe>
  void list(const char* key, const std::vector<T>& values, bool, std::size_t, const char*,
            Describe&& describe) {
    json[key] = Json::array();
    for (const T& value : values) json[key].push_back(written(value, describe));
  }
  template <class Read, class Write>
  void custom(const char* key, bool, const Json&, const char*, Read&&, Write&& write) {
    if (std::optional<Json> value = write()) json[key] = *std::move(value);
  }

 private:
  template <class T>
  void put(const char* key, const std::optional<T>& value) {
    if (value)
      json[key] = *value;
    else if (unset_ == Unset::null)
      json[key] = nullptr;
  }
  template <class T, class Describe>
  Json written(const T& value, Describe&& describe) const {
    ToJson codec(unset_);
    describe(codec, value);
    return std::move(codec.json);
  }

  Unset unset_;
};

/// The JSON Schema (draft 2020-12) of the description.
class ToSchema {
 public:
  Json json = {{"type", "object"},
               {"additionalProperties", false},
               {"required", Json::array()},
               {"properties", Json::object()}};

  static bool wants(bool) { return true; }
  template <class Work>
  void check(Work&&) {}
  template <class Work>
  void form(const char*, bool, bool, Work&& work) {
    in_a_form_ = true;
    work();
    in_a_form_ = false;
  }

  void text(const char* key, const std::string&, const char* help, TextLimits limits = {}) {
    add(key, true, {{"type", "string"}, {"minLength", limits.least}, {"maxLength", limits.most}}, help);
  }
  void text(const char* key, const std::optional<std::string>&, const char* help, TextLimits limits = {}) {
    add(key, false, {{"type", "string"}, {"maxLength", limits.most}}, help);
  }
  void text_or_default(const char* key, const std::string& value, const char* help, TextLimits limits) {
    text(key, std::optional(value), help, limits);
  }
  void number(const char* key, double, Range range, const char* help) {
    add(key, true, number_in(range), help);
  }
  void number(const char* key, const std::optional<double>&, Range range, const char* help) {
    add(key, false, number_in(range), help);
  }
  void number_or_default(const char* key, double value, Range range, const char* help) {
    Json schema = number_in(range);
    schema["default"] = value;
    add(key, false, std::move(schema), help);
  }
  void integer(const char* key, const std::optional<int>&, int low, int high, const char* help) {
    add(key, false, {{"type", "integer"}, {"minimum", low}, {"maximum", high}}, help);
  }
  template <std::integral Integer>
  void integer(const char* key, Integer, int low, int high, const char* help) {
    add(key, true, {{"type", "integer"}, {"minimum", low}, {"maximum", high}}, help);
  }
  void boolean(const char* key, const std::optional<bool>&, const char* help) {
    add(key, false, {{"type", "boolean"}}, help);
  }
  template <class Enum, std::size_t n>
  void choice(const char* key, Enum value, const std::array<std::string_view, n>& words, const char* help) {
    add(key, false, {{"enum", words}, {"default", words[std::size_t(value)]}}, help);
  }
  template <class Enum, std::size_t n>
  void choice(const char* key, const std::optional<Enum>&, const std::array<std::string_view, n>& words,
              const char* help) {
    add(key, false, {{"enum", words}}, help);
  }
  template <class Enum, std::size_t n>
  void required_choice(const char* key, Enum, const std::array<std::string_view, n>& words,
                       const char* help) {
    add(key, true, {{"enum", words}}, help);
  }
  template <class Vector>
  void vector(const char* key, const Vector&, Range range, const char* help) {
    add(key, true, numbers_in<Vector>(range), help);
  }
  template <class Vector>
  void vector(const char* key, const std::optional<Vector>&, Range range, const char* help) {
    add(key, false, numbers_in<Vector>(range), help);
  }
  template <class Matrix>
  void matrix(const char* key, const Matrix&, Range range, const char* help) {
    constexpr int n = Matrix::RowsAtCompileTime;
    const Json row = {{"type", "array"}, {"items", number_in(range)}, {"minItems", n}, {"maxItems", n}};
    add(key, true, {{"type", "array"}, {"items", row}, {"minItems", n}, {"maxItems", n}}, help);
  }
  void numbers(const char* key, const std::vector<double>&, std::size_t most, Range range, const char* help) {
    add(key, false, {{"type", "array"}, {"items", number_in(range)}, {"minItems", 1}, {"maxItems", most}},
        help);
  }
  void file(const char* key, const std::filesystem::path&, const std::filesystem::path&, const char* help) {
    add(key, true, path_schema(), help);
  }
  void file(const char* key, const std::optional<std::filesystem::path>&, const std::filesystem::path&,
            const char* help) {
    add(key, false, path_schema(), help);
  }
  template <class T, class Describe>
  void object(const char* key, const T&, const char* help, Describe&& describe) {
    add(key, false, described<T>(describe), help);
  }
  template <class T, class Describe>
  void required_object(const char* key, const T&, const char* help, Describe&& describe) {
    add(key, true, described<T>(describe), help);
  }
  template <class T, class Describe>
  void list(const char* key, const std::vector<T>&, bool required, std::size_t most, const char* help,
            Describe&& describe) {
    add(key, required, {{"type", "array"}, {"maxItems", most}, {"items", described<T>(describe)}}, help);
  }
  template <class Read, class Write>
  void custom(const char* key, bool required, const Json& schema, const char* help, Read&&, Write&&) {
    add(key, required, schema, help);
  }

 private:
  static Json number_in(Range range) {
    return {{"type", "number"}, {"minimum", range.low}, {"maximum", range.high}};
  }
  template <class Vector>
  static Json numbers_in(Range range) {
    constexpr int n = Vector::SizeAtCompileTime;
    return {{"type", "array"}, {"items", number_in(range)}, {"minItems", n}, {"maxItems", n}};
  }
  static Json path_schema() { return {{"type", "string"}, {"maxLength", 1000}}; }
  template <class T, class Describe>
  static Json described(Describe&& describe) {
    ToSchema codec;
    if constexpr (requires { typename T::value_type; }) {
      typename T::value_type value{};
      describe(codec, value);
    } else {
      T value{};
      describe(codec, value);
    }
    return std::move(codec.json);
  }
  /// An optional key may be null.
  void add(const char* key, bool required, Json schema, const char* help) {
    if (json["properties"].contains(key)) return;  // of several forms
    if (required && !in_a_form_)
      json["required"].push_back(key);
    else if (schema.contains("type"))
      schema["type"] = Json::array({schema["type"], "null"});
    else if (schema.contains("enum"))
      schema["enum"].push_back(nullptr);
    schema["description"] = help;
    json["properties"][key] = std::move(schema);
  }

  bool in_a_form_ = false;
};

/// The schema of a file, `describe(codec)` being its description.
template <class Describe>
Json schema_of(const char* file, Describe&& describe) {
  Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", file}};
  ToSchema codec;
  describe(codec);
  schema.update(codec.json);
  return schema;
}

}  // namespace helicarm
