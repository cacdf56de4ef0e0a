// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "helicarm/rectification/distortion_map.h"

namespace helicarm::rectification {

/// The map for resampling by ITK or 3D Slicer: NRRD, 3 floats (mm) at every `step_px`-th rectified pixel, one
/// slice. A rectified pixel (u, v) lies at (u, v, 0) * `pixel_mm` in LPS, and the raw one that belongs to it
/// at that position plus the displacement (linearly interpolated).
std::string displacement_field(const DistortionMap& map, const Eigen::Vector2d& pixel_mm, int step_px = 4);

}  // namespace helicarm::rectification
