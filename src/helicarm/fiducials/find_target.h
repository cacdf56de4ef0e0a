// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/exposure.h"

namespace helicarm {

/// Where a point was seen in one picture.
struct SeenPoint {
  Eigen::Vector2d uv_raw;
  Eigen::Vector2d uv;      ///< rectified
  double sigma_px;         ///< per axis, rectified
};

/// Finds a check target (ball, cross of wires, end of a wire) near the place where the calibrated view puts it.
/// target_not_found, not_seen (outside the picture).
Expected<SeenPoint> find_target(const Exposure& exposure, const DistortionMap& map, const View& view,
                                const CalibratorTarget& target);

/// The ball nearest to a click (picks with "snap": "ball"), its centre corrected for perspective and distortion.
Expected<SeenPoint> snap_to_ball(const Exposure& exposure, const DistortionMap& map, const Eigen::Vector2d& click_raw,
                                 std::optional<double> diameter_px);

}  // namespace helicarm
