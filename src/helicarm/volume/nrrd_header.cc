// SPDX-License-Identifier: Apache-2.0
#include "helicarm/volume/nrrd_header.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/volume/declared.h"
#include "helicarm/volume/voxels.h"
#include "helicarm/xray/dicom_elements.h"

namespace helicarm::volume {
namespace {

/// Fields that affect neither geometry nor values; a measurement frame is that of vectors and tensors.
constexpr std::array<std::string_view, 17> ignored = {
    "content", "number", "block size",        "blocksize",    "thicknesses", "labels",
    "centers", "min",    "centerings",        "max",          "old min",     "oldmin",
    "old max", "oldmax", "measurement frame", "sample units", "sampleunits"};
constexpr std::array<std::string_view, 18> interpreted = {
    "type",         "dimension",       "sizes",
    "encoding",     "endian",          "spacings",
    "space",        "space dimension", "space directions",
    "space origin", "data file",       "byte skip",
    "line skip",    "units",           "space units",
    "kinds",        "axis mins",       "axis maxs"};

/// Teem reads a field's name in letters of either case, and some names without a blank.
std::string nrrd_field(std::string_view text) {
  std::string name = small_letters(trimmed(text));
  for (const auto& [joined, usual] : {std::pair{"datafile", "data file"},
                                      {"byteskip", "byte skip"},
                                      {"lineskip", "line skip"},
                                      {"axismins", "axis mins"},
                                      {"axismaxs", "axis maxs"}})
    if (name == joined) name = usual;
  return name;
}

}  // namespace

NrrdHeader::NrrdHeader(std::string_view& rest, std::string origin) : origin_(std::move(origin)) {
  take_line(rest);  // the magic
  while (!rest.empty()) {
    const std::string_view line = take_line(rest);
    if (line.empty()) return;
    if (line.starts_with('#') || line.find(":=") != std::string_view::npos) continue;
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: the line {} is not a field", origin_, xray::quote(line)));
    const std::string name = nrrd_field(line.substr(0, colon));
    if (std::ranges::find(ignored, name) != ignored.end()) continue;
    if (std::ranges::find(interpreted, name) == interpreted.end())
      throw BadInput(Reason::unknown_key,
                     fmt::format("{}: the field {} is unknown", origin_, xray::quote(name)));
    if (!values_.emplace(name, trimmed(line.substr(colon + 1))).second)
      throw BadInput(Reason::bad_value, fmt::format("{}: {} is given twice", origin_, xray::quote(name)));
  }
  detached_end_ = true;
}

std::string NrrdHeader::field(const std::string& name) const { return fmt::format("{}: {}", origin_, name); }

std::string NrrdHeader::text(const std::string& name) const {
  const auto found = values_.find(name);
  return found == values_.end() ? "" : found->second;
}

std::string NrrdHeader::word(const std::string& name) const {
  return fmt::format("{}", fmt::join(words(name), " "));
}

std::vector<std::string> NrrdHeader::words(const std::string& name) const {
  std::vector<std::string> words;
  const std::string value = small_letters(text(name));
  for (std::size_t at = value.find_first_not_of(" \t"); at < value.size();) {
    const bool quoted = value[at] == '"';
    const std::size_t begin = quoted ? at + 1 : at;
    const std::size_t end = std::min(value.find_first_of(quoted ? "\"" : " \t", begin), value.size());
    words.push_back(value.substr(begin, end - begin));
    at = value.find_first_not_of(" \t", std::min(end + (quoted ? 1 : 0), value.size()));
  }
  return words;
}

std::vector<double> NrrdHeader::numbers(const std::string& name, std::size_t count) const {
  const std::string value = text(name);
  if (value.empty()) return {};
  return read_numbers(value, count, field(name), "(),");
}

double NrrdHeader::whole_number(const std::string& name, double low, double high) const {
  const auto value = numbers(name, 1);
  if (value.empty()) return 0;
  if (!(value[0] >= low && value[0] <= high && value[0] == std::floor(value[0])))
    throw BadInput(Reason::bad_value, fmt::format("{} is {}, must be {:.0f} to {:.0f}", field(name),
                                                  xray::quote(text(name)), low, high));
  return value[0];
}

}  // namespace helicarm::volume
