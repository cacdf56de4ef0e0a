// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/pipeline/result.h"

namespace helicarm::report {

/// The rectified image of a view as PNG, with labelled fiducials, points, planned tunnels and tool lines;
/// `path`: planned positions of the tool's tip (rectified pixels).
std::string overlay_png(const pipeline::Result& result, std::size_t view,
                        std::span<const Eigen::Vector2d> path = {});

/// Stem of a view's file names: its name, or view3 and the like if the name is unsuitable.
std::string file_stem(const std::string& view_name, std::size_t index);

/// The stem with _overlay.png.
std::string overlay_name(const std::string& view_name, std::size_t index);

}  // namespace helicarm::report
