// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/guidance/guide.h"

namespace helicarm::guidance {

/// A planned tunnel from `start` to `end` for the tool.
struct Tunnel {
  std::string name;
  std::optional<Eigen::Vector3d> start_in_tool;  ///< mm
  std::optional<Eigen::Vector3d> end_in_tool;
  std::optional<Eigen::Vector3d> axis_in_tool;  ///< unit, from start to end
  std::optional<double> length_mm;
  std::optional<Eigen::Matrix3d> axis_covariance = {};  ///< rad^2, across the axis; with tracker noise
  std::optional<double> length_sigma_mm = {};
  std::map<Bone, Place> start_in_bones = {}, end_in_bones = {};

  /// Standard deviation of the axis direction (root of the trace), degrees.
  std::optional<double> axis_sigma_deg() const;
};

inline constexpr double shortest_tunnel_mm = 1;
inline constexpr double longest_tunnel_mm = 200;

/// Refuses (bad_tunnel) a length outside the limits above. `axis_covariance` needs the covariance of the
/// calibration shared by both ends (empty: taken as exact).
Expected<Tunnel> plan_tunnel(const std::string& name, const PointInFrames& start, const PointInFrames& end,
                             const Eigen::MatrixXd& calibration_covariance, const TrackerNoise& noise);

}  // namespace helicarm::guidance
