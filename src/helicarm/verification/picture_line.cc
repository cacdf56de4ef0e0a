// SPDX-License-Identifier: Apache-2.0
#include "helicarm/verification/picture_line.h"

namespace helicarm {

std::optional<PictureLine> line_in_xray(const View& view, const ToolLine& line) {
  constexpr double nearest_mm = 1;
  if (view.depth(line.p1_in_calibrator) < nearest_mm || view.depth(line.p2_in_calibrator) < nearest_mm)
    return std::nullopt;
  return PictureLine{view.project(line.p1_in_calibrator), view.project(line.p2_in_calibrator)};
}

}  // namespace helicarm
