// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/surface_file.h"

#include <algorithm>
#include <charconv>

#include <fmt/format.h>

#include "helicarm/registration/surface.h"

namespace helicarm::registration {

void check_triangles(double triangles, const std::string& origin) {
  if (triangles > double(max_triangles))
    throw BadInput(Reason::bad_size,
                   fmt::format("{}: {:.0f} triangles, limit {}", origin, triangles, max_triangles));
}

void add_polygon(phantom::TriangleMesh& mesh, const std::vector<std::uint32_t>& corners) {
  for (std::size_t k = 2; k < corners.size(); ++k)
    mesh.triangles.push_back({corners[0], corners[k - 1], corners[k]});
}

std::string_view SurfaceWords::next() {
  constexpr std::string_view blanks = " \t\r\n";
  const std::size_t first = std::min(rest_.find_first_not_of(blanks), rest_.size());
  const std::size_t end = std::min(rest_.find_first_of(blanks, first), rest_.size());
  const std::string_view word = rest_.substr(first, end - first);
  rest_.remove_prefix(end);
  return word;
}

double SurfaceWords::number() {
  std::string_view word = next();
  if (word.empty()) throw BadInput(Reason::truncated, fmt::format("{}: ends within a number list", *origin_));
  if (word.starts_with('+')) word.remove_prefix(1);
  double value = 0;
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || stop != word.data() + word.size())
    throw BadInput(Reason::bad_value,
                   fmt::format("{}: \"{}\" is not a number", *origin_, word.substr(0, 40)));
  return value;
}

std::string_view SurfaceWords::line() {
  const std::string_view line = rest_.substr(0, rest_.find_first_of("\r\n"));
  rest_.remove_prefix(line.size());
  return line;
}

}  // namespace helicarm::registration
