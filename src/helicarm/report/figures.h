// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/pipeline/result.h"

namespace helicarm::report {

/// SVG of one view: the rectified image with labelled fiducials, residuals as magnified arrows with a scale
/// bar, plate dots, outliers, points, planned tunnels and tool lines (Fig. 17).
std::string view_figure(const pipeline::Result& result, std::size_t view);

/// SVG of the distortion: raw minus rectified position, magnified, over the image. Empty for a flat panel.
std::string distortion_figure(const pipeline::ViewResult& view);

}  // namespace helicarm::report
