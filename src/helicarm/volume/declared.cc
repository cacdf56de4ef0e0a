// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/declared.h"

#include <algorithm>
#include <map>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/failure.h"
#include "helicarm/volume/voxels.h"
#include "helicarm/xray/dicom_elements.h"

namespace helicarm::volume {
namespace {

/// A word of a text, and whether "=" or ":" follows it.
struct DeclaredWord {
  std::string text;
  bool assigns = false;
};

bool in_declared_word(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' ||
         static_cast<unsigned char>(c) >= 0x80;
}

std::vector<DeclaredWord> declared_words(std::string_view text) {
  std::vector<DeclaredWord> words;
  bool apart = true;
  for (const char c : text) {
    if (in_declared_word(c)) {
      if (apart) words.emplace_back();
      words.back().text += c;
      apart = false;
      continue;
    }
    apart = true;
    if ((c == '=' || c == ':') && !words.empty()) words.back().assigns = true;
  }
  return words;
}

bool one_of(const std::string& word, std::initializer_list<std::string_view> list) {
  return std::ranges::find(list, word) != list.end();
}

bool is_unit_key(const std::string& word) {
  return one_of(word, {"unit", "units", "lengthunit", "lengthunits", "coordinateunits", "spaceunits"});
}

/// "space" alone and "coordinate system" in its spellings; "color space" is another thing.
bool is_space_key(const std::string& before, const std::string& word) {
  if (one_of(word, {"coordinatesystem", "coordinatespace", "coordinateframe", "coordsys", "patientspace"}))
    return true;
  if (word == "space") return !one_of(before, {"color", "colour", "work", "parameter", "texture"});
  return one_of(before, {"coordinate", "coordinates", "coord", "anatomical", "patient"}) &&
         one_of(word, {"system", "frame", "orientation"});
}

void declare(std::string& field, const std::string& value, const char* name, const std::string& origin) {
  if (!field.empty() && small_letters(field) != small_letters(value))
    throw BadInput(Reason::bad_value, fmt::format("{}: the {} is {} and {}: remove the wrong one", origin,
                                                  name, xray::quote(field), xray::quote(value)));
  field = value;
}

}  // namespace

std::string small_letters(std::string_view text) {
  std::string small(text);
  std::ranges::transform(small, small.begin(),
                         [](char c) { return c >= 'A' && c <= 'Z' ? char(c + 32) : c; });
  return small;
}

std::optional<double> unit_in_mm(std::string_view unit) {
  std::string word = small_letters(trimmed(unit));
  // "metre" and "meter", "microns" and "micron".
  if (const auto metre = word.find("metre"); metre != std::string::npos) word.replace(metre, 5, "meter");
  if (word.size() > 2 && word.ends_with('s')) word.pop_back();
  static const std::map<std::string, double, std::less<>> units = {
      {"mm", 1},       {"millimeter", 1}, {"cm", 10},      {"centimeter", 10},   {"dm", 100},
      {"m", 1000},     {"meter", 1000},   {"um", 1e-3},    {"\u00b5m", 1e-3},    {"\u03bcm", 1e-3},
      {"\xb5m", 1e-3}, {"micron", 1e-3},  {"nm", 1e-6},    {"micrometer", 1e-3}, {"nanometer", 1e-6},
      {"in", 25.4},    {"inch", 25.4},    {"inche", 25.4}, {"decimeter", 100}};
  const auto found = units.find(word);
  return found == units.end() ? std::nullopt : std::optional(found->second);
}

double declared_unit(std::string_view unit, const std::string& field) {
  if (const auto mm = unit_in_mm(unit)) return *mm;
  throw BadInput(Reason::unsupported,
                 fmt::format("{} is {}, must be mm, cm, m, um, nm or inch; save the file in mm", field,
                             xray::quote(unit)));
}

std::optional<Eigen::Vector3d> signs_to_lps(std::string_view space) {
  const std::string word = small_letters(trimmed(space));
  if (one_of(word, {"lps", "left-posterior-superior"})) return Eigen::Vector3d(1, 1, 1);
  if (one_of(word, {"ras", "right-anterior-superior"})) return Eigen::Vector3d(-1, -1, 1);
  if (one_of(word, {"las", "left-anterior-superior"})) return Eigen::Vector3d(1, -1, 1);
  return std::nullopt;
}

Eigen::Vector3d declared_space(std::string_view space, const std::string& field) {
  if (const auto signs = signs_to_lps(space)) return *signs;
  throw BadInput(Reason::unsupported,
                 fmt::format("{} is {}, must be LPS (left-posterior-superior), RAS (right-anterior-superior) "
                             "or LAS (left-anterior-superior); save the file in LPS",
                             field, xray::quote(space)));
}

Declared declared_in(std::string_view text, const std::string& origin) {
  const std::vector<DeclaredWord> words = declared_words(text);
  Declared declared;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string key = small_letters(words[i].text);
    const bool space = is_space_key(i > 0 ? small_letters(words[i - 1].text) : "", key);
    if (!space && !is_unit_key(key)) continue;
    // The last word is a value: "units: in" are inches.
    std::size_t value = i + 1;
    bool assigned = words[i].assigns;
    for (; value + 1 < words.size() &&
           one_of(small_letters(words[value].text), {"is", "are", "in", "of", "the"});
         ++value)
      assigned = assigned || words[value].assigns;
    if (value == words.size()) continue;
    const std::string& word = words[value].text;
    const bool known = space ? signs_to_lps(word).has_value() : unit_in_mm(word).has_value();
    if (!known && !assigned) continue;
    space ? declare(declared.space, word, "space", origin) : declare(declared.unit, word, "unit", origin);
  }
  return declared;
}

}  // namespace helicarm::volume
