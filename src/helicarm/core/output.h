// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <concepts>
#include <functional>
#include <optional>
#include <ranges>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "helicarm/core/json.h"

namespace helicarm {

/// One description of an object that is only written gives its writer and its schema:
///
///     template <class Output>
///     void describe(Output& output, const Line& line) {
///       output.value("name", line.name, "of the line");
///       output.value("length_mm", [&] { return line.length(); }, "from end to end");
///     }
///
/// A value is a bool, a number, a text, an Eigen vector or matrix, a list or an optional of these, or a
/// function that returns one, which only `OutputJson` calls: `OutputSchema` describes a default-constructed
/// object. All keys are written: nothing, and a number that is not finite, is null. Codecs for what is read
/// too: core/codec.h.
namespace output {

template <class Value>
decltype(auto) evaluated(const Value& value) {
  if constexpr (std::invocable<const Value&>)
    return value();
  else
    return (value);
}
template <class Value>
using Evaluated = std::remove_cvref_t<decltype(evaluated(std::declval<const Value&>()))>;

template <class T>
concept Text = std::convertible_to<T, std::string_view>;
template <class T>
concept Optional = requires(const T& value) {
  value.has_value();
  *value;
};
/// T without the optional around it.
template <class T>
struct RequiredOf {
  using type = T;
};
template <Optional T>
struct RequiredOf<T> {
  using type = std::remove_cvref_t<decltype(*std::declval<const T&>())>;
};
template <class T>
using Required = typename RequiredOf<T>::type;
template <class T>
concept Matrix = requires {
  typename T::Scalar;
  T::RowsAtCompileTime;
  T::ColsAtCompileTime;
};
template <class T>
concept ColumnVector = Matrix<T> && T::ColsAtCompileTime == 1;

/// Names and values.
template <class T>
concept Map = std::ranges::range<T> && Text<typename std::ranges::range_value_t<T>::first_type>;

/// A matrix as a list of rows, a vector as a list, a map as an object.
template <class T>
Json json_of(const T& value) {
  if constexpr (std::same_as<T, Json>) {
    return value;
  } else if constexpr (Optional<T>) {
    return value ? json_of(*value) : Json(nullptr);
  } else if constexpr (Text<T>) {
    return std::string(value);
  } else if constexpr (std::floating_point<T>) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
  } else if constexpr (Matrix<T>) {
    Json list = Json::array();
    if constexpr (ColumnVector<T>)
      for (const auto& number : value) list.push_back(json_of(number));
    else
      for (const auto& row : value.rowwise()) list.push_back(json_of(row.transpose().eval()));
    return list;
  } else if constexpr (Map<T>) {
    Json object = Json::object();
    for (const auto& [name, item] : value) object[name] = json_of(item);
    return object;
  } else if constexpr (std::ranges::range<T>) {
    Json list = Json::array();
    for (const auto& item : value) list.push_back(json_of(item));
    return list;
  } else {
    return value;
  }
}

/// For `value`: what `part` gives of an optional or a pointer, or nothing where that is not set. Neither is
/// copied.
template <class Whole, class Part>
auto if_set(const Whole& whole, Part part) {
  return [&whole, part] {
    using Value = std::remove_cvref_t<std::invoke_result_t<Part, decltype(*whole)>>;
    std::optional<Required<Value>> value;
    if (whole) value = std::invoke(part, *whole);
    return value;
  };
}

inline Json or_null(Json schema) {
  if (schema.contains("type") && schema["type"].is_string())
    schema["type"] = Json::array({schema["type"], "null"});
  else if (schema.contains("enum"))
    schema["enum"].push_back(nullptr);
  return schema;
}

inline constexpr int any_count = -1;  // as Eigen::Dynamic

inline Json list_schema(Json items, int count) {
  Json schema = {{"type", "array"}, {"items", std::move(items)}};
  if (count >= 0) schema["minItems"] = schema["maxItems"] = count;
  return schema;
}

template <class T>
Json schema_of_type() {
  if constexpr (std::same_as<T, Json>)
    return Json::object();
  else if constexpr (Optional<T>)
    return or_null(schema_of_type<Required<T>>());
  else if constexpr (Text<T>)
    return {{"type", "string"}};
  else if constexpr (std::same_as<T, bool>)
    return {{"type", "boolean"}};
  else if constexpr (std::integral<T>)
    return {{"type", "integer"}};
  else if constexpr (std::floating_point<T>)
    return {{"type", {"number", "null"}}};
  else if constexpr (ColumnVector<T>)
    return list_schema(schema_of_type<typename T::Scalar>(), T::RowsAtCompileTime);
  else if constexpr (Matrix<T>)
    return list_schema(list_schema(schema_of_type<double>(), T::ColsAtCompileTime), T::RowsAtCompileTime);
  else if constexpr (Map<T>)
    return {{"type", "object"},
            {"additionalProperties",
             schema_of_type<std::remove_cvref_t<typename std::ranges::range_value_t<T>::second_type>>()}};
  else
    return list_schema(schema_of_type<std::ranges::range_value_t<T>>(), any_count);
}

}  // namespace output

/// Writes into `json`, in the order of the description.
class OutputJson {
 public:
  Json json = Json::object();

  template <class Value>
  void value(const char* key, const Value& value, const char*) {
    json[key] = output::json_of(output::evaluated(value));
  }
  /// One of `words`, or nothing.
  template <class Value, std::size_t n>
  void word(const char* key, const Value& value, const std::array<std::string_view, n>&, const char* help) {
    this->value(key, value, help);
  }
  /// A key that is written only where `present`.
  template <class Value>
  void value_where(bool present, const char* key, const Value& value, const char* help) {
    if (present) this->value(key, value, help);
  }
  /// An object, or null: `describe(output)`.
  template <class Describe>
  void object(const char* key, bool is_set, const char*, Describe&& describe) {
    json[key] = is_set ? written(describe) : Json(nullptr);
  }
  /// Of an optional: `describe(output, value)`.
  template <output::Optional T, class Describe>
  void object_of(const char* key, const T& value, const char* help, Describe&& describe) {
    object(key, value.has_value(), help, [&](OutputJson& row) { describe(row, *value); });
  }
  /// Likewise, of a key that is written only where `present`.
  template <output::Optional T, class Describe>
  void object_where(bool present, const char* key, const T& value, const char* help, Describe&& describe) {
    if (present) object_of(key, value, help, describe);
  }
  /// A list of objects: `describe(output, item)`. `items` is a range, an optional one, or a function that
  /// returns one.
  template <class Items, class Describe>
  void list(const char* key, const Items& items, const char*, Describe&& describe) {
    json[key] = nullptr;
    const auto& listed = output::evaluated(items);
    if constexpr (output::Optional<output::Evaluated<Items>>) {
      if (listed) list(key, *listed, "", describe);
    } else {
      Json& rows = json[key] = Json::array();
      for (const auto& item : listed) rows.push_back(written([&](OutputJson& row) { describe(row, item); }));
    }
  }
  /// An object with a key for each item; `items` is a range of pairs, or a function that returns one.
  template <class Items, class Describe>
  void map(const char* key, const Items& items, const char*, Describe&& describe) {
    Json& rows = json[key] = Json::object();
    for (const auto& [name, item] : output::evaluated(items))
      rows[name] = written([&](OutputJson& row) { describe(row, item); });
  }

 private:
  template <class Describe>
  static Json written(Describe&& describe) {
    OutputJson row;
    describe(row);
    return std::move(row.json);
  }
};

/// The JSON Schema (draft 2020-12) of the description.
class OutputSchema {
 public:
  Json json = {{"type", "object"}, {"required", Json::array()}, {"properties", Json::object()}};

  template <class Value>
  void value(const char* key, const Value&, const char* help) {
    add(key, output::schema_of_type<output::Evaluated<Value>>(), help);
  }
  template <class Value, std::size_t n>
  void word(const char* key, const Value&, const std::array<std::string_view, n>& words, const char* help) {
    const Json schema = {{"enum", words}};
    add(key, output::Optional<output::Evaluated<Value>> ? output::or_null(schema) : schema, help);
  }
  template <class Value>
  void value_where(bool, const char* key, const Value& value, const char* help) {
    this->value(key, value, help);
    json["required"].erase(json["required"].size() - 1);
  }
  template <class Describe>
  void object(const char* key, bool, const char* help, Describe&& describe) {
    add(key, output::or_null(described(describe)), help);
  }
  template <output::Optional T, class Describe>
  void object_of(const char* key, const T&, const char* help, Describe&& describe) {
    const output::Required<T> value{};
    object(key, false, help, [&](OutputSchema& row) { describe(row, value); });
  }
  template <output::Optional T, class Describe>
  void object_where(bool, const char* key, const T& value, const char* help, Describe&& describe) {
    object_of(key, value, help, describe);
    json["required"].erase(json["required"].size() - 1);
  }
  template <class Items, class Describe>
  void list(const char* key, const Items&, const char* help, Describe&& describe) {
    using Listed = output::Evaluated<Items>;
    const std::ranges::range_value_t<output::Required<Listed>> item{};
    const Json schema = {{"type", "array"},
                         {"items", described([&](OutputSchema& row) { describe(row, item); })}};
    add(key, output::Optional<Listed> ? output::or_null(schema) : schema, help);
  }
  template <class Items, class Describe>
  void map(const char* key, const Items&, const char* help, Describe&& describe) {
    const typename std::ranges::range_value_t<output::Evaluated<Items>>::second_type item{};
    const Json of_item = described([&](OutputSchema& row) { describe(row, item); });
    add(key, {{"type", "object"}, {"additionalProperties", of_item}}, help);
  }

 private:
  template <class Describe>
  static Json described(Describe&& describe) {
    OutputSchema row;
    describe(row);
    return std::move(row.json);
  }
  void add(const char* key, Json schema, const char* help) {
    json["required"].push_back(key);
    schema["description"] = help;
    json["properties"][key] = std::move(schema);
  }
};

/// What `describe(output)` writes.
template <class Describe>
Json output_of(Describe&& describe) {
  OutputJson output;
  describe(output);
  return std::move(output.json);
}

/// The schema of a file, `describe(output)` being its description. Later versions may add keys.
template <class Describe>
Json output_schema(const char* file, Describe&& describe) {
  Json schema = {{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", file}};
  OutputSchema output;
  describe(output);
  schema.update(output.json);
  return schema;
}

}  // namespace helicarm
