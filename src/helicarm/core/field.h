// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"

namespace helicarm {

/// A numeric option set by a CLI flag, a dialog field or a file key: its single definition of name, range and
/// help.
template <class Options>
struct Field {
  std::string_view name;        ///< key in files: "max_error_mm"
  std::string_view label = {};  ///< shown to the user; empty: the name without its unit
  std::string_view flag = {};   ///< CLI option: "--max-error"; empty: no option of its own
  std::string_view unit = {};   ///< "mm"; empty: dimensionless
  Range range;
  double step = 0;  ///< allowed values are range.low + n * step; 0: continuous
  std::string_view help;
  std::span<const std::string_view> words = {};  ///< for a choice: the value is an index into these
  bool optional = false;                         ///< may be unset
  std::optional<double> (*get)(const Options&) = nullptr;
  void (*set)(Options&, std::optional<double>) = nullptr;
};

namespace detail {

template <class T>
struct OptionsOf;
template <class Options, class Value>
struct OptionsOf<Value Options::*> {
  using type = Options;
};

template <class T>
inline constexpr bool is_optional = false;
template <class T>
inline constexpr bool is_optional<std::optional<T>> = true;

template <auto... members>
constexpr auto& member_of(auto& options) {
  return (options.*....*members);
}

}  // namespace detail

/// Binds a field to a member or nested member: bound<&Plan::tracker, &Tracker::rate>({...}).
template <auto first, auto... rest>
constexpr auto bound(Field<typename detail::OptionsOf<decltype(first)>::type> field) {
  using Options = typename detail::OptionsOf<decltype(first)>::type;
  using Value = std::remove_cvref_t<decltype(detail::member_of<first, rest...>(std::declval<Options&>()))>;
  field.optional = detail::is_optional<Value>;
  field.get = [](const Options& options) -> std::optional<double> {
    const Value& value = detail::member_of<first, rest...>(options);
    if constexpr (detail::is_optional<Value>)
      return value;
    else
      return static_cast<double>(value);
  };
  field.set = [](Options& options, std::optional<double> number) {
    Value& value = detail::member_of<first, rest...>(options);
    if constexpr (detail::is_optional<Value>)
      value = number;
    else if (number)
      value = static_cast<Value>(*number);
  };
  return field;
}

/// A field of one part's options as a field of the whole that holds them, by the same name, limits and help.
template <auto first, auto... rest, class Part>
constexpr auto bound_as(const Field<Part>& part) {
  return bound<first, rest...>({.name = part.name,
                                .label = part.label,
                                .flag = part.flag,
                                .unit = part.unit,
                                .range = part.range,
                                .step = part.step,
                                .help = part.help,
                                .words = part.words});
}

/// The field of this name; an unknown name is a compile error in a constant expression.
template <class Options>
constexpr const Field<Options>& field_named(std::span<const Field<Options>> fields, std::string_view name) {
  for (const Field<Options>& field : fields)
    if (field.name == name) return field;
  throw std::out_of_range("no such field");
}

/// "1 to 1000 Hz", or "best or paper".
template <class Options>
std::string limits_of(const Field<Options>& field) {
  if (!field.words.empty()) return fmt::format("{}", fmt::join(field.words, " or "));
  const std::string step = field.step > 1 ? fmt::format(" in steps of {:g}", field.step) : "";
  return fmt::format("{:.12g} to {:.12g}{}{}{}", field.range.low, field.range.high,
                     field.unit.empty() ? "" : " ", field.unit, step);
}

/// Refuses (bad_value) a number outside the field's limits; the message names field, value and limits.
template <class Options>
Expected<void> check_number(const Field<Options>& field, std::optional<double> number,
                            const std::string& origin) {
  if (!number && field.optional) return {};
  const auto steps = [&] { return (*number - field.range.low) / field.step; };
  if (number && *number >= field.range.low && *number <= field.range.high &&
      (field.step == 0 || steps() == std::floor(steps())))
    return {};
  return fail(Reason::bad_value,
              fmt::format("{}: {}: {} is not {}", origin, field.name,
                          number ? fmt::format("{:.12g}", *number) : "nothing", limits_of(field)));
}

/// Checks all fields of `options`.
template <class Options>
Expected<void> check_fields(std::span<const Field<std::type_identity_t<Options>>> fields,
                            const Options& options, const std::string& origin) {
  for (const auto& field : fields)
    if (auto checked = check_number(field, field.get(options), origin); !checked) return checked;
  return {};
}

/// Label of the input field: `label`, or "Max error" for "max_error_mm".
template <class Options>
std::string label_of(const Field<Options>& field) {
  if (!field.label.empty()) return std::string(field.label);
  std::string label(field.name);
  std::string unit(field.unit);
  std::ranges::transform(unit, unit.begin(),
                         [](unsigned char c) { return c == '/' ? '_' : std::tolower(c); });
  if (!unit.empty() && label.ends_with("_" + unit)) label.resize(label.size() - unit.size() - 1);
  std::ranges::replace(label, '_', ' ');
  if (!label.empty()) label[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(label[0])));
  return label;
}

}  // namespace helicarm
