// SPDX-License-Identifier: Apache-2.0
#include <cstring>

#include <fmt/format.h>

#include "helicarm/registration/surface_file.h"
#include "helicarm/volume/declared.h"

namespace helicarm::registration {
namespace {

constexpr std::size_t stl_header = 84, stl_facet = 50, stl_title = 80;

template <class T>
T value_at(std::string_view bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

std::size_t stated_size(std::string_view bytes) {
  return stl_header + stl_facet * std::size_t{value_at<std::uint32_t>(bytes, stl_title)};
}

std::string_view without_mark(std::string_view bytes) {
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
  return bytes.substr(std::min(bytes.find_first_not_of(" \t\r\n"), bytes.size()));
}

/// The name behind "solid": a line, or what precedes the first facet where all is one line.
std::string_view stl_name(SurfaceWords& words) {
  const std::string_view rest = words.rest();
  const std::string_view line = words.line();
  const std::size_t facet = volume::small_letters(line).find("facet normal");
  if (facet == std::string::npos) return line;
  words = SurfaceWords(rest.substr(facet), words.origin());
  return line.substr(0, facet);
}

}  // namespace

bool is_sized_stl(std::string_view bytes) {
  return bytes.size() >= stl_header && bytes.size() == stated_size(bytes);
}

/// The header of a binary file may begin with "solid" too.
bool is_text_stl(std::string_view bytes) {
  constexpr std::size_t looked_at = 4000;
  const std::string start = volume::small_letters(without_mark(bytes).substr(0, looked_at));
  return start.starts_with("solid") && start.find('\0') == std::string::npos &&
         (start.find("facet") != std::string::npos || start.find("endsolid") != std::string::npos);
}

SurfaceFile text_stl(std::string_view bytes, const std::string& origin) {
  SurfaceFile file;
  SurfaceWords words(without_mark(bytes), origin);
  std::vector<std::uint32_t> facet;
  bool open = false, ended = false;
  for (std::string word = volume::small_letters(words.next()); !word.empty();
       word = volume::small_letters(words.next())) {
    if (word == "solid") {
      const std::string_view name = stl_name(words);
      if (file.declares.empty()) file.declares = name.substr(0, longest_declaration);
    } else if (word == "endsolid") {
      words.line();
      ended = true;
    } else if (word == "facet") {
      if (open)
        throw BadInput(Reason::bad_value, fmt::format("{}: facet {} has no \"endfacet\"", origin,
                                                      file.mesh.triangles.size() + 1));
      open = true, ended = false;
      facet.clear();
    } else if (word == "vertex") {
      const double x = words.number(), y = words.number(), z = words.number();
      facet.push_back(static_cast<std::uint32_t>(file.mesh.corners.size()));
      file.mesh.corners.emplace_back(x, y, z);
      check_triangles(double(file.mesh.corners.size()) / 3, origin);
    } else if (word == "endfacet") {
      if (facet.size() < 3)
        throw BadInput(Reason::bad_value, fmt::format("{}: facet {} has {} corners, must be 3", origin,
                                                      file.mesh.triangles.size() + 1, facet.size()));
      add_polygon(file.mesh, facet);
      facet.clear();
      open = false;
    }
  }
  if (open)
    throw BadInput(Reason::truncated,
                   fmt::format("{}: ends within facet {}", origin, file.mesh.triangles.size() + 1));
  if (!ended)
    file.warnings.push_back(
        {Reason::irregular_file,
         fmt::format("{}: does not end with \"endsolid\": facets may be missing", origin)});
  return file;
}

SurfaceFile binary_stl(std::string_view bytes, const std::string& origin) {
  if (bytes.size() < stl_header)
    throw BadInput(Reason::truncated, fmt::format("{}: {} bytes, neither STL, PLY, OBJ nor PolyData of VTK",
                                                  origin, bytes.size()));
  const auto count = value_at<std::uint32_t>(bytes, stl_title);
  const std::size_t needed = stated_size(bytes);
  if (bytes.size() < needed)
    throw BadInput(
        Reason::truncated,
        fmt::format(
            "{}: is cut off, or no surface (STL, PLY, OBJ, VTP, VTK): {} bytes, {} triangles of an STL "
            "file need {}",
            origin, bytes.size(), count, needed));
  check_triangles(count, origin);
  SurfaceFile file;
  file.declares = bytes.substr(0, std::min(bytes.find('\0'), stl_title));
  if (bytes.size() > needed)
    file.warnings.push_back({Reason::surplus_data,
                             fmt::format("{}: {} bytes follow the {} triangles that the header states: check "
                                         "their number, or save the surface again",
                                         origin, bytes.size() - needed, count),
                             {},
                             {{"surplus_bytes", double(bytes.size() - needed)}}});
  file.mesh.corners.reserve(3 * std::size_t{count});
  for (std::size_t i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint32_t>(file.mesh.corners.size());
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = [&](std::size_t j) {
        return double(value_at<float>(bytes, stl_header + stl_facet * i + 12 + 12 * k + 4 * j));
      };
      file.mesh.corners.emplace_back(axis(0), axis(1), axis(2));
    }
    file.mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return file;
}

}  // namespace helicarm::registration
