// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/vtk_cursor.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include <fmt/format.h>

#include "helicarm/volume/declared.h"

namespace helicarm::registration {
namespace {

constexpr VtkType vtk_types[] = {
    {"char", 1, 'i'},         {"signed_char", 1, 'i'},    {"unsigned_char", 1, 'u'},
    {"short", 2, 'i'},        {"unsigned_short", 2, 'u'}, {"int", 4, 'i'},
    {"unsigned_int", 4, 'u'}, {"float", 4, 'f'},          {"double", 8, 'f'},
    {"vtkidtype", 4, 'i'},    {"vtktypeint64", 8, 'i'},   {"vtktypeuint64", 8, 'u'}};

double vtk_number(std::string_view word, char kind) {
  std::uint64_t bits = 0;
  for (const char byte : word) bits = bits << 8 | static_cast<unsigned char>(byte);
  const std::size_t width = 8 * word.size();
  if (kind == 'f' && width == 32) return double(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
  if (kind == 'f') return std::bit_cast<double>(bits);
  if (kind == 'u') return double(bits);
  const std::size_t unused = 64 - width;
  return double(static_cast<std::int64_t>(bits << unused) >> unused);
}

}  // namespace

void VtkCursor::refuse(Reason reason, const std::string& what) const {
  throw BadInput(reason, fmt::format("{}: {}", origin_, what));
}

std::string VtkCursor::next_small() { return volume::small_letters(words_.next().substr(0, 100)); }

std::string_view VtkCursor::take_line() {
  const std::string_view line = words_.line(), rest = words_.rest();
  words_ = SurfaceWords(rest.substr(rest.starts_with("\r\n") ? 2 : std::min<std::size_t>(1, rest.size())),
                        origin_);
  return line;
}

std::string_view VtkCursor::take(std::size_t bytes, std::string_view what) {
  const std::string_view rest = words_.rest();
  if (rest.size() < bytes)
    refuse(Reason::truncated, fmt::format("{} needs {} bytes, {} are left", what, bytes, rest.size()));
  words_ = SurfaceWords(rest.substr(bytes), origin_);
  return rest.substr(0, bytes);
}

std::size_t VtkCursor::count(std::string_view what, std::size_t limit) {
  const double value = words_.number();
  if (!(value >= 0 && value == std::floor(value)))
    refuse(Reason::bad_value,
           fmt::format("{}: the number is {}, must be whole and not negative", what, value));
  if (value > double(limit))
    refuse(Reason::bad_size, fmt::format("{} is {:.0f}, limit {}", what, value, limit));
  return static_cast<std::size_t>(value);
}

const VtkType& VtkCursor::type_of(std::string_view what) {
  const std::string name = next_small();
  for (const VtkType& type : vtk_types)
    if (type.name == name) return type;
  refuse(Reason::unsupported, fmt::format("{}: numbers of type \"{}\"", what, name));
}

VtkCursor::Values VtkCursor::values(const VtkType& type, std::size_t number, std::string_view what) {
  Values all;
  if (text_) {
    if (number > words_.rest().size())
      refuse(Reason::truncated,
             fmt::format("{} needs {} numbers, {} bytes are left", what, number, words_.rest().size()));
    all.reserve(number);
    for (std::size_t i = 0; i < number; ++i) all.push_back(words_.number());
    return all;
  }
  take_line();
  const std::string_view bytes = take(number * type.bytes, what);
  all.reserve(number);
  for (std::size_t i = 0; i < number; ++i)
    all.push_back(vtk_number(bytes.substr(i * type.bytes, type.bytes), type.kind));
  return all;
}

void VtkCursor::skip_metadata() {
  take_line();
  while (!words_.rest().empty())
    if (take_line().empty()) return;
}

}  // namespace helicarm::registration
