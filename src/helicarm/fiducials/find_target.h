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

namespace helicarm::fiducials {

/// A point measured in one image.
struct ImagePoint {
  Eigen::Vector2d uv_raw;
  Eigen::Vector2d uv;  ///< rectified
  double sigma_px;     ///< per axis, rectified
};

/// Measures a check target (ball, wire cross, wire end) near its projection by fitting a template of its
/// absorption, rendered for this view. Pixels in the discs `others` are left out; `noise` is the image's.
/// Fails with target_not_found, with not_seen if the projection lies outside the image, or behind_source.
Expected<ImagePoint> find_target(const xray::XrayImage& xray_image, const rectification::DistortionMap& map,
                                 const geometry::View& view, const phantom::CalibratorTarget& target,
                                 std::span<const detection::Disc> others,
                                 const detection::NoiseCorrelation& noise);

/// Standard deviation of a click per axis, where none is given.
inline constexpr double click_sigma_px = 0.5;

/// A pick with "snap": "none": its standard deviation includes the map's. Fails with not_seen where the map
/// cannot be inverted.
Expected<ImagePoint> point_of_click(const rectification::DistortionMap& map, const Eigen::Vector2d& click_raw,
                                    std::optional<double> sigma_px);

/// A pick with "snap": "ball": the image of the centre of the ball at the click, assumed at `depth_mm` from
/// the source. Fails with target_not_found if no such ball lies within its radius (at least 5 px) of the
/// click.
Expected<ImagePoint> snap_to_ball(const xray::XrayImage& xray_image, const rectification::DistortionMap& map,
                                  const geometry::View& view, double depth_mm,
                                  const Eigen::Vector2d& click_raw, double diameter_mm,
                                  const detection::NoiseCorrelation& noise);

}  // namespace helicarm::fiducials
