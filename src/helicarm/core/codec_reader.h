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

}  // namespace helicarm
