// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/core/json.h"
#include "helicarm/detection/dot.h"
#include "helicarm/fiducials/find_target.h"
#include "helicarm/rectification/distortion_map.h"
#include "helicarm/xray/xray_image.h"

namespace helicarm::fiducials {

/// `--method paper`: circles on the rectified image (Eq. 1-3, bilinear) by median, Canny and Hough, in
/// rectified pixels; radii in [low, high] px.
std::vector<detection::Dot> find_circles_paper(const xray::XrayImage& xray_image,
                                               const rectification::DistortionMap& map, Range radii_px);

/// The circle's centre as the image of the ball's: without the perspective's offset.
ImagePoint point_of_circle(const detection::Dot& circle, const rectification::DistortionMap& map);

/// The circle of about `radius_px` nearest to `uv` (rectified), within its radius, at least 5 px.
/// target_not_found if there is none.
Expected<ImagePoint> circle_near(const xray::XrayImage& xray_image, const rectification::DistortionMap& map,
                                 const Eigen::Vector2d& uv, double radius_px);

}  // namespace helicarm::fiducials
