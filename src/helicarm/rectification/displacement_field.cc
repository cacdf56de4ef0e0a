// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/displacement_field.h"

#include <bit>

#include <fmt/format.h>

namespace helicarm::rectification {

std::string displacement_field(const DistortionMap& map, const Eigen::Vector2d& pixel_mm, int step_px) {
  static_assert(std::endian::native == std::endian::little, "the header says so");
  const auto nodes = [&](int side) {
    return (side - 2 + step_px) / step_px + 1;
  };  // the last one at or beyond the edge
  const int columns = nodes(map.width), rows = nodes(map.height);
  std::string text = fmt::format(
      "NRRD0005\n# rectified to raw position, mm, LPS\ntype: float\ndimension: 4\nspace: "
      "left-posterior-superior\n"
      "sizes: 3 {} {} 1\nspace directions: none ({},0,0) (0,{},0) (0,0,1)\nkinds: vector domain domain "
      "domain\n"
      "endian: little\nencoding: raw\nspace origin: (0,0,0)\n\n",
      columns, rows, pixel_mm.x() * step_px, pixel_mm.y() * step_px);
  text.reserve(text.size() + std::size_t(columns) * std::size_t(rows) * 3 * sizeof(float));
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const Eigen::Vector2d at = step_px * Eigen::Vector2d(column, row);
      const Eigen::Vector2d moved = (map.raw_from_rectified(at) - at).cwiseProduct(pixel_mm);
      const float displacement[3] = {float(moved.x()), float(moved.y()), 0};
      text.append(reinterpret_cast<const char*>(displacement), sizeof displacement);
    }
  return text;
}

}  // namespace helicarm::rectification
