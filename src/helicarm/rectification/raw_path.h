// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "helicarm/rectification/distortion_map.h"

namespace helicarm::rectification {

/// A polyline in pixels.
using PixelPath = std::vector<Eigen::Vector2d>;

/// A path in rectified pixels mapped to the raw image: curved by the distortion, and cut where it leaves the
/// image or the map folds.
std::vector<PixelPath> raw_paths(const DistortionMap& map, std::span<const Eigen::Vector2d> rectified);

}  // namespace helicarm::rectification
