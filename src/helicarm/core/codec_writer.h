// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/codec_reader.h"

namespace helicarm {

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

}  // namespace helicarm
