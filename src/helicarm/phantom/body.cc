// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/body.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <fmt/format.h>

#include "helicarm/phantom/open_body.h"
#include "helicarm/phantom/simplify.h"

namespace helicarm::phantom {
namespace {

constexpr double simplified_within_mm = 0.02;  // a tenth of a printed layer and less

using Polygon = std::vector<Eigen::Vector2d>;

/// Signed distance to a polygon, negative inside; exact.
double polygon_distance(const Polygon& polygon, const Eigen::Vector2d& p) {
  double nearest = INFINITY;
  bool inside = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Eigen::Vector2d edge = polygon[j] - polygon[i];
    const Eigen::Vector2d from = p - polygon[i];
    nearest =
        std::min(nearest, (from - edge * std::clamp(from.dot(edge) / edge.squaredNorm(), 0.0, 1.0)).norm());
    if ((polygon[i].y() > p.y()) != (polygon[j].y() > p.y()) && from.x() < edge.x() * from.y() / edge.y())
      inside = !inside;
  }
  return inside ? -nearest : nearest;
}

/// The outer cone and its derived quantities.
struct Cone {
  explicit Cone(const BodyOptions& options)
      : base(options.base_diameter_mm / 2),
        slope((options.base_diameter_mm - options.top_diameter_mm) / 2 / options.height_mm) {}

  double radius(double z) const { return base - slope * z; }
  double secant() const { return std::hypot(1, slope); }
  /// Depth below the outer surface along its normal.
  double depth(const Eigen::Vector3d& p) const { return (radius(p.z()) - p.head<2>().norm()) / secant(); }
  Eigen::Vector3d normal(double azimuth) const {
    return Eigen::Vector3d(std::cos(azimuth), std::sin(azimuth), slope) / secant();
  }
  Eigen::Vector3d surface(double azimuth, double z) const {
    return {radius(z) * std::cos(azimuth), radius(z) * std::sin(azimuth), z};
  }

  double base;
  double slope;
};

/// Half section of the body in (distance from the axis, z); it crosses the axis so that no edge lies there.
Polygon section(const Cone& cone, const BodyOptions& options) {
  const double bottom = -options.flange_depth_mm;
  const double flange_top = bottom + std::min(options.wall_mm, options.flange_depth_mm);
  const double rim = cone.radius(bottom) + options.flange_width_mm;
  const double ceiling = options.height_mm - options.wall_mm;
  const auto inner = [&](double z) { return cone.radius(z) - options.wall_mm * cone.secant(); };
  return {{inner(bottom), bottom},
          {rim, bottom},
          {rim, flange_top},
          {cone.radius(flange_top), flange_top},
          {cone.radius(options.height_mm), options.height_mm},
          {-10, options.height_mm},
          {-10, ceiling},
          {inner(ceiling), ceiling}};
}

/// Flat square on the outer surface at half height, thick enough to reach the curved wall at its edges.
struct Facet {
  Eigen::Vector3d centre;
  Eigen::Matrix3d axes;  ///< columns: across, up the slope, outward
  Eigen::Vector3d half;

  double distance(const Eigen::Vector3d& p) const {
    const Eigen::Vector3d q = (axes.transpose() * (p - centre)).cwiseAbs() - half;
    return q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0);
  }
};

Facet facet_at(const Cone& cone, const BodyOptions& options, double azimuth) {
  const double half_side = options.facet_side_mm / 2;
  const double sagitta = half_side * half_side / (2 * cone.radius(options.height_mm / 2 + half_side));
  const double proud = 0.8;
  const Eigen::Vector3d outward = cone.normal(azimuth);
  const Eigen::Vector3d across(-std::sin(azimuth), std::cos(azimuth), 0);
  const double half_thickness = (proud + sagitta + 0.7) / 2;
  Facet facet;
  facet.centre = cone.surface(azimuth, options.height_mm / 2) + (proud - half_thickness) * outward;
  facet.axes << across, outward.cross(across), outward;
  facet.half = {half_side, half_side, half_thickness};
  return facet;
}

/// Groove in the outer surface, in the plane through two balls and the outward direction between them.
struct Groove {
  Eigen::Vector3d start, end, across, outward;

  double distance(const Eigen::Vector3d& p, const Cone& cone, const BodyOptions& options) const {
    const Eigen::Vector3d chord = end - start;
    const double along = (p - start).dot(chord) / chord.squaredNorm();
    const double beyond = (std::abs(along - 0.5) - 0.5) * chord.norm();
    const double inward = -(p - (start + end) / 2).dot(outward);
    return std::max({std::abs((p - start).dot(across)) - options.groove_width_mm / 2,
                     cone.depth(p) - options.groove_depth_mm, beyond, inward - 5});
  }
};

std::vector<Groove> grooves_of(const Calibrator& calibrator) {
  std::map<std::string, Eigen::Vector3d> places;
  for (const auto& ball : calibrator.balls) places[ball.label] = ball.centre_in_calibrator;
  std::vector<Groove> grooves;
  // The lines of 2.3.4 (4); a straight one up the cone passes its middle ball.
  for (const auto& [from, to] : {std::pair{"P3", "P7"},
                                 {"P7", "P11"},
                                 {"P4", "P8"},
                                 {"P8", "P12"},
                                 {"P1", "P2"},
                                 {"P5", "P6"},
                                 {"P9", "P10"}}) {
    if (!places.count(from) || !places.count(to)) continue;
    const Eigen::Vector3d start = places[from], end = places[to], middle = (start + end) / 2;
    const Eigen::Vector3d outward = Eigen::Vector3d(middle.x(), middle.y(), 0).normalized();
    grooves.push_back({start, end, (end - start).cross(outward).normalized(), outward});
  }
  return grooves;
}

/// Of the plastic about a ball.
double seat_radius(const CalibratorBall& ball, const BodyOptions& options) {
  return ball.diameter_mm / 2 + options.wall_mm / 2;
}

double azimuth_of(const Eigen::Vector3d& p) { return std::atan2(p.y(), p.x()); }

Expected<void> check_wall(const Calibrator& calibrator, const BodyOptions& options) {
  const Cone cone(options);
  for (const auto& ball : calibrator.balls) {
    const double depth = cone.depth(ball.centre_in_calibrator);
    const double z = ball.centre_in_calibrator.z();
    if (depth < -ball.diameter_mm / 4 || depth > options.wall_mm + ball.diameter_mm / 2 || z < 0 ||
        z > options.height_mm)
      return fail(
          Reason::bad_value,
          fmt::format(
              "{}: ball {} lies {:.2f} mm below the cone's surface at z = {:.2f} mm: outside the wall; "
              "choose --body rings or plate",
              calibrator.name, ball.label, depth, z),
          {{"depth_mm", depth}, {"z_mm", z}});
  }
  return {};
}

Expected<void> check_range(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  return fail(Reason::bad_value, fmt::format("{}: {} is outside {} to {}", name, value, low, high));
}

}  // namespace

SignedDistance body_distance(const Calibrator& calibrator, const BodyOptions& options) {
  if (options.shape != BodyShape::cone) return open_body_distance(calibrator, options);
  const Cone cone(options);
  std::vector<Facet> facets;
  for (int k = 0; k < 4; ++k)  // halfway between the columns of balls
    facets.push_back(facet_at(
        cone, options,
        azimuth_of(calibrator.balls.front().centre_in_calibrator) + std::numbers::pi * (0.25 + 0.5 * k)));
  return [=, balls = calibrator.balls, profile = section(cone, options),
          grooves = grooves_of(calibrator)](const Eigen::Vector3d& p) {
    double distance = polygon_distance(profile, {p.head<2>().norm(), p.z()});
    if (std::abs(distance) > 25) return distance;
    for (const auto& ball : balls)
      distance = std::min(distance, (p - ball.centre_in_calibrator).norm() - seat_radius(ball, options));
    for (const auto& facet : facets) distance = std::min(distance, facet.distance(p));
    for (const auto& groove : grooves) distance = std::max(distance, -groove.distance(p, cone, options));
    for (const auto& ball : balls)
      distance = std::max(distance, -pocket_distance(ball, cone.normal(azimuth_of(ball.centre_in_calibrator)),
                                                     options.clearance_mm, p));
    return distance;
  };
}

BodyShape suitable_shape(const Calibrator& calibrator, const BodyOptions& options) {
  return check_wall(calibrator, options) ? BodyShape::cone : BodyShape::rings;
}

namespace {

/// The surface is followed through a grid of so many points: minutes.
constexpr double most_grid_points = 5e8;

Eigen::AlignedBox3d cone_box(const Calibrator& calibrator, const BodyOptions& options) {
  const double reach = Cone(options).radius(-options.flange_depth_mm) + options.flange_width_mm;
  Eigen::AlignedBox3d box(Eigen::Vector3d(-reach, -reach, -options.flange_depth_mm),
                          Eigen::Vector3d(reach, reach, options.height_mm));
  for (const CalibratorBall& ball : calibrator.balls) {
    const Eigen::Vector3d seat = Eigen::Vector3d::Constant(seat_radius(ball, options));
    box.extend(ball.centre_in_calibrator - seat);
    box.extend(ball.centre_in_calibrator + seat);
  }
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(2 * options.step_mm);
  return {box.min() - margin, box.max() + margin};
}

}  // namespace

Expected<TriangleMesh> printable_body(const Calibrator& calibrator, const BodyOptions& options) {
  const auto checked =
      check_range("step_mm", options.step_mm, 0.2, 3)
          .and_then([&] { return check_range("clearance_mm", options.clearance_mm, -0.5, 2); })
          .and_then([&]() -> Expected<void> {
            if (options.shape == BodyShape::cone) return check_wall(calibrator, options);
            return options.shape == BodyShape::plate ? check_posts(calibrator, options)
                                                     : check_pockets(calibrator, options);
          });
  if (!checked) return tl::unexpected<Failure>(checked.error());
  const Eigen::AlignedBox3d box =
      options.shape == BodyShape::cone ? cone_box(calibrator, options) : open_body_box(calibrator, options);
  const double points = (box.sizes() / options.step_mm).prod();
  if (points > most_grid_points)
    return fail(
        Reason::bad_value,
        fmt::format("{}: a body of {:.0f} x {:.0f} x {:.0f} mm in steps of {:g} mm is too large: a step "
                    "of {:.2g} mm or more would do",
                    calibrator.name, box.sizes().x(), box.sizes().y(), box.sizes().z(), options.step_mm,
                    std::ceil(100 * std::cbrt(box.volume() / most_grid_points)) / 100),
        {{"step_mm", options.step_mm}});
  return simplified(surface_of(body_distance(calibrator, options), box, options.step_mm),
                    simplified_within_mm);
}

}  // namespace helicarm::phantom
