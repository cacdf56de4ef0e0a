// SPDX-License-Identifier: Apache-2.0
#include "helicarm/guidance/image_line.h"

namespace helicarm::guidance {

std::optional<ImageLine> line_in_xray(const geometry::View& view, const ToolLine& line) {
  constexpr double nearest_mm = 1;
  if (view.depth(line.p1_in_calibrator) < nearest_mm || view.depth(line.p2_in_calibrator) < nearest_mm)
    return std::nullopt;
  return ImageLine{view.project(line.p1_in_calibrator), view.project(line.p2_in_calibrator)};
}

}  // namespace helicarm::guidance
