// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "helicarm/track/body_pose.h"
#include "helicarm/track/smooth.h"

namespace helicarm::track {

/// Point of least weighted squares of two or more sights with its covariance; nothing for parallel rays or a
/// point behind a source.
struct SightedPoint {
  Eigen::Vector3d place;
  Eigen::Matrix3d covariance;
  double ray_gap_mm = 0;
  double chi2 = 0;
};
std::optional<SightedPoint> sighted_point(std::span<const Sight> sights);

/// The place after more images, linearised where they put it.
FramePlace with_sights(FramePlace prior, std::span<const Sight> seen);

}  // namespace helicarm::track
