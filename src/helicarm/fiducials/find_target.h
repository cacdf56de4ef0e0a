// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "helicarm/core/failure.h"
#include "helicarm/detection/fit_dot.h"
#include "helicarm/detection/noise.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm {

/// Where a point was seen in one image.
struct ImagePoint {
  Eigen::Vector2d uv_raw;
  Eigen::Vector2d uv;  ///< rectified
  double sigma_px;     ///< per axis, rectified
};

/// Finds a check target (ball, cross of wires, end of a wire) near the place where the calibrated view puts
/// it: the absorption of the solid itself, drawn for this view, is shifted until it fits the pixels. `others`
/// are discs to leave out, `noise` is that of the exposure. target_not_found; not_seen when it falls outside
/// the image.
Expected<ImagePoint> find_target(const XrayImage& xray_image, const DistortionMap& map, const View& view,
                                 const CalibratorTarget& target, std::span<const Disc> others,
                                 const NoiseCorrelation& noise);

/// Standard deviation of a click per axis, where none is given.
inline constexpr double click_sigma_px = 0.5;

/// A click as it is (picks with "snap": "none"), its noise joined with the map's. not_seen where the map
/// cannot be inverted.
Expected<ImagePoint> see_click(const DistortionMap& map, const Eigen::Vector2d& click_raw,
                               std::optional<double> sigma_px);

/// The image of the centre of the ball nearest to a click (picks with "snap": "ball"). The ball is taken to
/// be at `depth_mm` from the source. target_not_found where no such ball is within its own radius of the
/// click.
Expected<ImagePoint> snap_to_ball(const XrayImage& xray_image, const DistortionMap& map, const View& view,
                                  double depth_mm, const Eigen::Vector2d& click_raw, double diameter_mm,
                                  const NoiseCorrelation& noise);

}  // namespace helicarm
