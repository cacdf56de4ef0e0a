// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/measure.h"

#include <cmath>
#include <functional>

#include <fmt/format.h>

#include "helicarm/geometry/triangulation.h"
#include "helicarm/measures/planar.h"
#include "helicarm/measures/reference.h"
#include "helicarm/measures/roles.h"

namespace helicarm::measures {
namespace {

/// Clicks in the object plane, or in pixels.
struct Placed {
  PlanarPoints points;
  std::vector<Eigen::Matrix2d> covariances;
  std::string unit = "px";
  double relative_sigma = 0;  ///< of lengths
};

Placed placed(std::span<const Click> clicks, const std::optional<ObjectPlane>& plane) {
  Placed all;
  for (const Click& click : clicks) {
    all.points.push_back(plane ? plane->place_of(click.uv) : click.uv);
    const Eigen::Matrix2d scale = plane ? plane->scale() : Eigen::Matrix2d(Eigen::Matrix2d::Identity());
    all.covariances.emplace_back(scale * click.covariance_px2 * scale.transpose());
  }
  if (plane) {
    all.unit = "mm";
    all.relative_sigma = plane->relative_sigma;
  }
  return all;
}

using Values = std::function<Eigen::VectorXd(const PlanarPoints&)>;

Quantity length(const std::string& name, const Placed& placed, const Values& value, Eigen::Index row = 0) {
  const double at = value(placed.points)[row];
  const double variance = propagated(value, placed.points, placed.covariances)(row, row);
  return {name, placed.unit, at, std::hypot(std::sqrt(variance), at * placed.relative_sigma)};
}

Quantity angle(const Placed& placed, const Values& value) {
  return {"angle", "deg", value(placed.points)[0],
          std::sqrt(propagated(value, placed.points, placed.covariances)(0, 0))};
}

Eigen::VectorXd one(double value) { return Eigen::VectorXd::Constant(1, value); }

constexpr double least_length_px = 1;     // of what gives a length or a direction
constexpr double least_line_share = 0.1;  // of two points that give a direction, of the span along it

tl::unexpected<Failure> too_near(const KindInfo& info, std::string_view one, std::string_view other) {
  return fail(Reason::bad_value,
              fmt::format("{}: \"{}\" and \"{}\" are less than {:g} px apart", info.word, one, other,
                          least_length_px),
              {{"limit_px", least_length_px}});
}

bool are_near(std::span<const Click> clicks, std::size_t a, std::size_t b) {
  return (clicks[a].uv - clicks[b].uv).norm() < least_length_px;
}

Expected<Measure> measured_distance(const Placed& placed, const Assigned& who,
                                    std::span<const Click> clicks) {
  const std::size_t from = who.roles.at("from"), to = who.roles.at("to");
  if (are_near(clicks, from, to)) return too_near(info_of(Kind::distance), "from", "to");
  return Measure{
      Kind::distance,
      {length("length", placed, [&](const PlanarPoints& p) { return one((p[to] - p[from]).norm()); })}};
}

Expected<Measure> measured_angle(Kind kind, const Placed& placed, const Assigned& who,
                                 std::span<const Click> clicks) {
  const auto at = [&](std::string_view role) { return who.roles.at(role); };
  const KindInfo& info = info_of(kind);
  if (kind == Kind::angle) {
    for (const std::string_view end : {"first", "second"})
      if (are_near(clicks, at(end), at("vertex"))) return too_near(info, end, "vertex");
    return Measure{kind, {angle(placed, [&](const PlanarPoints& p) {
                     return one(angle_deg(p[at("first")], p[at("vertex")], p[at("second")]));
                   })}};
  }
  for (const auto& [from, to] : {std::pair{"line1_from", "line1_to"}, {"line2_from", "line2_to"}})
    if (are_near(clicks, at(from), at(to))) return too_near(info, from, to);
  return Measure{kind, {angle(placed, [&](const PlanarPoints& p) {
                   return one(line_angle_deg(p[at("line1_to")] - p[at("line1_from")],
                                             p[at("line2_to")] - p[at("line2_from")]));
                 })}};
}

Expected<Measure> measured_circle(const Placed& placed) {
  const auto circle = fit_circle(placed.points);
  if (!circle)
    return fail(Reason::bad_value, "circle: the points lie on a line or do not determine a circle");
  const auto diameter = [](const PlanarPoints& p) {
    const auto fitted = fit_circle(p);
    return one(fitted ? 2 * fitted->radius : std::nan(""));
  };
  Measure measure{Kind::circle, {length("diameter", placed, diameter)}};
  if (placed.points.size() > 3)
    measure.quantities.push_back({"residual_rms", placed.unit, circle->residual_rms, {}});
  return measure;
}

Expected<Measure> measured_percent(const KindInfo& info, const Placed& placed, const Assigned& who,
                                   std::span<const Click> clicks) {
  const PercentAxes axes{info.kind, who};
  PlanarPoints pixels;
  for (const Click& click : clicks) pixels.push_back(click.uv);
  const double least = axes.spans(pixels).minCoeff();
  if (!(least >= least_length_px))
    return fail(Reason::bad_value,
                fmt::format("{}: the landmarks for 0 and 100 % are {:.2g} px apart, must be {:g} px or more",
                            info.word, least, least_length_px),
                {{"length_px", least}, {"limit_px", least_length_px}});
  const double line = axes.line(pixels).norm();
  const double shortest =
      std::max(least_length_px, least_line_share * (axes.hundred(pixels) - axes.zero(pixels)).norm());
  if (!(line >= shortest))
    return fail(
        Reason::bad_value,
        fmt::format("{}: the two points of {} are {:.2g} px apart, must be {:.2g} px or more: they give "
                    "its direction",
                    info.word, info.kind == Kind::femoral_quadrants ? "Blumensaat's line" : "the plateau",
                    line, shortest),
        {{"length_px", line}, {"limit_px", shortest}});
  if (info.kind == Kind::femoral_quadrants && axes.has("posterior") &&
      (axes.hundred(pixels) - axes.zero(pixels)).dot(axes.direction(pixels)) < 0)
    return fail(
        Reason::bad_value,
        fmt::format("{}: \"posterior\" and \"anterior\" contradict the direction of Blumensaat's line: "
                    "one of the two pairs is exchanged",
                    info.word));
  Measure measure{info.kind, {}};
  const Values lengths = [&](const PlanarPoints& p) { return axes.spans(p); };
  for (std::size_t i = 0; i < info.spans.size(); ++i)
    measure.quantities.push_back(length(std::string(info.spans[i]), placed, lengths, Eigen::Index(i)));
  for (const std::size_t point : who.further) {
    const Values percent = [&](const PlanarPoints& p) { return axes.percent(p, p[point]); };
    measure.positions.push_back(
        {clicks[point].name, percent(placed.points), propagated(percent, placed.points, placed.covariances)});
    Position& position = measure.positions.back();
    position.warnings = reference_warnings(axes, position, placed.points, point);
  }
  return measure;
}

Expected<Measure> measured(const KindInfo& info, const Placed& placed, const Assigned& who,
                           std::span<const Click> clicks) {
  switch (info.kind) {
    case Kind::distance:
      return measured_distance(placed, who, clicks);
    case Kind::angle:
    case Kind::line_angle:
      return measured_angle(info.kind, placed, who, clicks);
    case Kind::circle:
      return measured_circle(placed);
    default:
      return measured_percent(info, placed, who, clicks);
  }
}

}  // namespace

Expected<Measure> measure(Kind kind, std::span<const Click> clicks, const std::optional<ObjectPlane>& plane) {
  const KindInfo& info = info_of(kind);
  const auto who = assigned(info, clicks);
  if (!who) return tl::unexpected<Failure>(who.error());
  auto measure = measured(info, placed(clicks, plane), *who, clicks);
  if (!measure) return measure;
  if (plane) measure->depth_mm = plane->depth_mm;
  return measure;
}

Expected<Click> click_of(const std::string& name, const Eigen::Vector3d& point,
                         const Eigen::Matrix3d& covariance_mm2, const geometry::View& view) {
  if (!(view.depth(point) > 0))
    return fail(Reason::behind_source, fmt::format("\"{}\" lies behind the view's source", name),
                {{"depth_mm", view.depth(point)}});
  const auto by = geometry::projection_jacobian(view, point);
  return Click{name, view.project(point), by * covariance_mm2 * by.transpose()};
}

}  // namespace helicarm::measures
