// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/guidance/guide.h"

namespace helicarm {

/// A planned tunnel from `start` to `end` as an order for the tool: data only.
struct Tunnel {
  std::string name;
  std::optional<Eigen::Vector3d> start_in_tool;  ///< mm
  std::optional<Eigen::Vector3d> end_in_tool;
  std::optional<Eigen::Vector3d> axis_in_tool;  ///< unit, from start to end
  std::optional<double> length_mm;
};

inline constexpr double shortest_tunnel_mm = 1;
inline constexpr double longest_tunnel_mm = 200;

/// Refuses (bad_tunnel) a length outside these limits.
Expected<Tunnel> plan_tunnel(const std::string& name, const GuidedPoint& start, const GuidedPoint& end);

}  // namespace helicarm
