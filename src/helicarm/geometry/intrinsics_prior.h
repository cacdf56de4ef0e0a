// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <Eigen/Core>

namespace helicarm::geometry {

/// A normal distribution of a number, known before the measurement.
struct NormalPrior {
  double value = 0;
  double sigma = 0;
};

/// Prior of one view's intrinsics (rectified px); absent members are unknown.
struct IntrinsicsPrior {
  std::optional<double> focal_px = {};  ///< nominal mean of |fx| and fy
  std::optional<Eigen::Vector2d> principal_px = {};
  double unit_px = 1;  ///< unit of a C-arm's prior in this view: px per mm on the detector, or 1
  std::optional<NormalPrior> aspect = {};                   ///< |fx| / fy: 1 for square pixels
  std::optional<NormalPrior> skew = NormalPrior{0, 1e-12};  ///< over fy; nothing: free
};

}  // namespace helicarm::geometry
