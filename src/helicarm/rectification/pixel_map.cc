// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/pixel_map.h"

#include <charconv>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/files.h"

namespace helicarm::rectification {
namespace {

constexpr std::uintmax_t most_grid_bytes = 16 << 20;
constexpr double most_px = 1e5;

std::vector<Eigen::Vector2d> pairs_in(const std::filesystem::path& file) {
  const std::string text = value_or_throw(read_file(file, most_grid_bytes)),
                    origin = file.filename().string();
  std::vector<Eigen::Vector2d> pairs;
  for (std::size_t at = 0, line = 1; at < text.size(); ++line) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const std::string_view row(text.data() + at, end - at);
    at = end + 1;
    if (row.find_first_not_of(" \t\r") == row.npos) continue;
    Eigen::Vector2d pair;
    const char* from = row.data();
    const char* const last = row.data() + row.size();
    for (int i = 0; i < 2; ++i) {
      while (from != last && (*from == ' ' || *from == '\t' || (i == 1 && *from == ','))) ++from;
      const auto [behind, error] = std::from_chars(from, last, pair[i]);
      if (error != std::errc{} || !(std::abs(pair[i]) < most_px))
        throw BadInput(Reason::bad_value,
                       fmt::format("{}: line {}: two numbers x,y are expected", origin, line));
      from = behind;
    }
    if (std::string_view(from, std::size_t(last - from)).find_first_not_of(" \t\r") != std::string_view::npos)
      throw BadInput(Reason::bad_value,
                     fmt::format("{}: line {}: two numbers x,y are expected", origin, line));
    pairs.push_back(pair);
  }
  return pairs;
}

}  // namespace

Expected<std::vector<Correspondence>> read_xmalab_grid(const std::filesystem::path& raw,
                                                       const std::filesystem::path& undistorted) {
  return guarded([&] {
    const auto from = pairs_in(raw), to = pairs_in(undistorted);
    if (from.size() != to.size())
      throw BadInput(Reason::bad_size, fmt::format("{} has {} dots, {} has {}", raw.filename().string(),
                                                   from.size(), undistorted.filename().string(), to.size()));
    std::vector<Correspondence> dots;
    for (std::size_t i = 0; i < from.size(); ++i) dots.push_back({to[i], from[i]});
    return dots;
  });
}

}  // namespace helicarm::rectification
