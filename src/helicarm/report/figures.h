// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/pipeline/result.h"

namespace helicarm {

/// SVG of one view: the rectified image with balls and labels, residuals as magnified arrows with a scale
/// bar, plate dots, false blobs, points, planned tunnels and tool lines (Fig. 17).
std::string view_figure(const Result& result, std::size_t view);

/// SVG of the distortion: raw less rectified, magnified, over the image's field. Empty for a flat panel.
std::string distortion_figure(const ViewResult& view);

}  // namespace helicarm
