// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/drawing.h"

#include <cmath>
#include <numbers>

#include "helicarm/measures/roles.h"

namespace helicarm::measures {
namespace {

using Eigen::Vector2d;

Vector2d normal_of(const Vector2d& direction) { return {-direction.y(), direction.x()}; }

std::vector<Stroke> circle_of(const PlanarPoints& points) {
  const auto circle = fit_circle(points);
  if (!circle) return {};
  constexpr int parts = 96;
  Stroke stroke;
  for (int i = 0; i <= parts; ++i) {
    const double angle = 2 * std::numbers::pi * i / parts;
    stroke.path.emplace_back(circle->centre + circle->radius * Vector2d(std::cos(angle), std::sin(angle)));
  }
  return {stroke};
}

/// A rectangle from `corner` along both sides, in quarters.
std::vector<Stroke> grid_of(const Vector2d& corner, const Vector2d& along, const Vector2d& across) {
  std::vector<Stroke> grid;
  for (int i = 0; i <= 4; ++i) {
    const double at = 0.25 * i;
    const bool is_fine = i % 4 != 0;
    grid.push_back({{corner + at * along, corner + at * along + across}, is_fine});
    grid.push_back({{corner + at * across, corner + at * across + along}, is_fine});
  }
  return grid;
}

/// The diameter with a tick at each quarter.
std::vector<Stroke> scale_of(const Vector2d& zero, const Vector2d& along) {
  constexpr double tick = 0.06;  // of the diameter
  std::vector<Stroke> strokes{{{zero, zero + along}}};
  for (int i = 0; i <= 4; ++i) {
    const Vector2d at = zero + 0.25 * i * along, side = tick * normal_of(along);
    strokes.push_back({{at - side, at + side}, i % 4 != 0});
  }
  return strokes;
}

std::vector<Stroke> percent_drawing(Kind kind, const Assigned& who, const PlanarPoints& points) {
  const PercentAxes axes{kind, who};
  const Vector2d direction = axes.direction(points), zero = axes.zero(points);
  const Vector2d along = (axes.hundred(points) - zero).dot(direction) * direction;
  if (kind != Kind::femoral_quadrants) return scale_of(zero, along);
  const Vector2d normal = normal_of(direction), line = axes.at(points, "blumensaat_posterior");
  const Vector2d across = (axes.at(points, "inferior") - line).dot(normal) * normal;
  return grid_of(line + (zero - line).dot(direction) * direction, along, across);
}

}  // namespace

std::vector<Stroke> drawing_of(Kind kind, std::span<const Click> clicks) {
  const auto who = assigned(info_of(kind), clicks);
  if (!who || !measure(kind, clicks, {})) return {};
  PlanarPoints points;
  for (const Click& click : clicks) points.push_back(click.uv);
  const auto at = [&](std::string_view role) { return points[who->roles.at(role)]; };
  switch (kind) {
    case Kind::distance:
      return {{{at("from"), at("to")}}};
    case Kind::angle:
      return {{{at("first"), at("vertex"), at("second")}}};
    case Kind::line_angle:
      return {{{at("line1_from"), at("line1_to")}}, {{at("line2_from"), at("line2_to")}}};
    case Kind::circle:
      return circle_of(points);
    default:
      return percent_drawing(kind, *who, points);
  }
}

}  // namespace helicarm::measures
