// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/codec_reader.h"

namespace helicarm {

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
