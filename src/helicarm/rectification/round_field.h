// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <Eigen/Core>

#include "helicarm/xray/xray_image.h"

namespace helicarm::rectification {

/// The field of an image intensifier: an ellipse with axes along u and v, a circle unless the image was
/// resampled with unequal pixels.
struct RoundField {
  Eigen::Vector2d centre_px;
  Eigen::Vector2d radius_px;  ///< along u and v

  /// Width over height.
  double aspect() const { return radius_px.x() / radius_px.y(); }
};

/// The boundary between dark corners and the field as an ellipse; nothing where the field reaches the corners
/// or its boundary has another shape, such as a flat panel's or a collimator's.
std::optional<RoundField> round_field(const xray::XrayImage& xray_image);

}  // namespace helicarm::rectification
