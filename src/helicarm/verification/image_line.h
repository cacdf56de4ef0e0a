// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/verification/verify.h"

namespace helicarm {

/// A line in a rectified image.
struct ImageLine {
  Eigen::Vector2d back;
  Eigen::Vector2d tip;
};

/// The tool's line in a calibrated X-ray (Eq. 6); nothing where it lies behind the source.
std::optional<ImageLine> line_in_xray(const View& view, const ToolLine& line);

}  // namespace helicarm
