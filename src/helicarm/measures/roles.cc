// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/roles.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

namespace helicarm::measures {

Expected<Assigned> assigned(const KindInfo& info, std::span<const Click> clicks) {
  const auto refused = [&](const std::string& why) {
    return fail(Reason::bad_value, fmt::format("{}: {}", info.word, why));
  };
  Assigned found;
  std::set<std::string> names;
  for (std::size_t i = 0; i < clicks.size(); ++i) {
    const Click& click = clicks[i];
    if (!names.insert(click.name).second) return refused(fmt::format("\"{}\" is given twice", click.name));
    if (const auto role = std::ranges::find(info.roles, click.name, &Role::word); role != info.roles.end())
      found.roles[role->word] = i;
    else if (info.further != Further::refused)
      found.further.push_back(i);
    else
      return refused(fmt::format("\"{}\" is none of its points", click.name));
  }
  const bool any_optional = std::ranges::any_of(
      info.roles, [&](const Role& role) { return role.is_optional && found.roles.contains(role.word); });
  for (const Role& role : info.roles)
    if (!found.roles.contains(role.word) && (any_optional || !role.is_optional))
      return refused(fmt::format("\"{}\" is missing: {}", role.word, role.place));
  return found;
}

Eigen::Vector2d PercentAxes::zero(const PlanarPoints& points) const {
  switch (kind) {
    case Kind::femoral_quadrants:
      return at(points, has("posterior") ? "posterior" : "blumensaat_posterior");
    case Kind::tibia_ap:
      return at(points, "anterior");
    default:
      return at(points, "medial");
  }
}

Eigen::Vector2d PercentAxes::hundred(const PlanarPoints& points) const {
  switch (kind) {
    case Kind::femoral_quadrants:
      return at(points, has("anterior") ? "anterior" : "blumensaat_anterior");
    case Kind::tibia_ap:
      return at(points, "posterior");
    default:
      return at(points, "lateral");
  }
}

Eigen::Vector2d PercentAxes::line(const PlanarPoints& points) const {
  if (kind == Kind::femoral_quadrants)
    return at(points, "blumensaat_anterior") - at(points, "blumensaat_posterior");
  return has("plateau1") ? at(points, "plateau2") - at(points, "plateau1") : hundred(points) - zero(points);
}

Eigen::Vector2d PercentAxes::direction(const PlanarPoints& points) const { return line(points).normalized(); }

Eigen::VectorXd PercentAxes::percent(const PlanarPoints& points, const Eigen::Vector2d& point) const {
  const Eigen::Vector2d way = direction(points);
  const double along = percent_along(point, zero(points), hundred(points), way);
  if (kind != Kind::femoral_quadrants) return Eigen::VectorXd::Constant(1, along);
  return Eigen::Vector2d(
      along, percent_across(point, at(points, "blumensaat_posterior"), way, at(points, "inferior")));
}

Eigen::VectorXd PercentAxes::spans(const PlanarPoints& points) const {
  const Eigen::Vector2d way = direction(points);
  const double along = std::abs((hundred(points) - zero(points)).dot(way));
  if (kind != Kind::femoral_quadrants) return Eigen::VectorXd::Constant(1, along);
  const Eigen::Vector2d down = at(points, "inferior") - at(points, "blumensaat_posterior");
  return Eigen::Vector2d(along, std::abs(way.x() * down.y() - way.y() * down.x()));
}

}  // namespace helicarm::measures
