// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/guidance/verify.h"

namespace helicarm::guidance {

/// A line in a rectified image.
struct ImageLine {
  Eigen::Vector2d back;
  Eigen::Vector2d tip;
};

/// Projection of the tool's line into a calibrated view (Eq. 6); nothing if it lies behind the source.
std::optional<ImageLine> line_in_xray(const geometry::View& view, const ToolLine& line);

}  // namespace helicarm::guidance
