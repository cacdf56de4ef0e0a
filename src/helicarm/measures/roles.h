// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string_view>
#include <vector>

#include "helicarm/measures/measure.h"
#include "helicarm/measures/planar.h"

namespace helicarm::measures {

/// Clicks by what they are, as indices.
struct Assigned {
  std::map<std::string_view, std::size_t> roles;
  std::vector<std::size_t> further;
};

/// Refuses as `measure`.
Expected<Assigned> assigned(const KindInfo& info, std::span<const Click> clicks);

/// The axes along which per cent are counted. Each is linear in the point.
struct PercentAxes {
  Kind kind;
  Assigned clicks;

  const Eigen::Vector2d& at(const PlanarPoints& points, std::string_view role) const {
    return points[clicks.roles.at(role)];
  }
  bool has(std::string_view role) const { return clicks.roles.contains(role); }
  /// From 0 to 100 % of the first component, along its direction.
  Eigen::Vector2d zero(const PlanarPoints& points) const;
  Eigen::Vector2d hundred(const PlanarPoints& points) const;
  /// Between the two points that give the direction.
  Eigen::Vector2d line(const PlanarPoints& points) const;
  Eigen::Vector2d direction(const PlanarPoints& points) const;
  Eigen::VectorXd percent(const PlanarPoints& points, const Eigen::Vector2d& point) const;
  /// Lengths of 100 % of each component.
  Eigen::VectorXd spans(const PlanarPoints& points) const;
};

}  // namespace helicarm::measures
