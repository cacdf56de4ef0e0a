// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/pipeline/result.h"

namespace helicarm {

/// The rectified image of a view as PNG, with balls and labels, points, planned tunnels and tool lines
/// drawn in; `path`: where the tool's tip will go (rectified pixels).
std::string overlay_png(const Result& result, std::size_t view, std::span<const Eigen::Vector2d> path = {});

/// What files of a view are named by: its name; view3 and the like where that does not suit a file.
std::string file_stem(const std::string& view_name, std::size_t index);

/// The stem and _overlay.png.
std::string overlay_name(const std::string& view_name, std::size_t index);

}  // namespace helicarm
