// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/solid.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace helicarm::simulation {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr Interval nothing{0, 0};

Solid placed(Solid::Kind kind, const Eigen::Matrix3d& axes, const Eigen::Vector3d& origin, double taper = 1) {
  Solid solid{.kind = kind, .taper = taper};
  solid.world_from_unit.linear() = axes;
  solid.world_from_unit.translation() = origin;
  solid.unit_from_world = solid.world_from_unit.inverse();
  return solid;
}

Interval both(const Interval& a, const Interval& b) {
  const Interval part{std::max(a.enter, b.enter), std::min(a.leave, b.leave)};
  return part.leave > part.enter ? part : nothing;
}

/// Interval of t with low <= o + t d <= high.
Interval slab(double o, double d, double low, double high) {
  if (d == 0) return o < low || o > high ? nothing : Interval{-infinity, infinity};
  const double a = (low - o) / d;
  const double b = (high - o) / d;
  return {std::min(a, b), std::max(a, b)};
}

/// Both for a ray whose t = 0 is nearest the solid, which avoids cancellation.
Interval in_ball(const Eigen::Vector3d& o, const Eigen::Vector3d& d) {
  const double a = d.squaredNorm();
  const double middle = -o.dot(d) / a;
  const double left = 1 - (o + middle * d).squaredNorm();
  if (left <= 0) return nothing;
  const double half = std::sqrt(left / a);
  return {middle - half, middle + half};
}

Interval in_frustum(const Eigen::Vector3d& o, const Eigen::Vector3d& d, double taper) {
  const Interval ends = slab(o.z(), d.z(), 0, 1);
  if (ends.leave <= ends.enter) return nothing;
  // x^2 + y^2 <= (1 + k z)^2 as a t^2 + 2 b t + c <= 0.
  const double k = taper - 1;
  const double radius = 1 + k * o.z();
  const double a = d.x() * d.x() + d.y() * d.y() - k * k * d.z() * d.z();
  const double b = o.x() * d.x() + o.y() * d.y() - k * d.z() * radius;
  const double c = o.x() * o.x() + o.y() * o.y() - radius * radius;
  if (std::abs(a) < 1e-14 * d.squaredNorm()) {
    if (b == 0) return c <= 0 ? ends : nothing;
    const double crossing = -c / (2 * b);
    return both(ends, b > 0 ? Interval{-infinity, crossing} : Interval{crossing, infinity});
  }
  const double discriminant = b * b - a * c;
  if (discriminant <= 0) return a < 0 ? ends : nothing;
  const double root = std::sqrt(discriminant);
  const double first = (-b - root) / a;
  const double second = (-b + root) / a;
  if (a > 0) return both(ends, {first, second});
  // Steeper than the wall: inside beyond either root, one per nappe; between the ends there is only one
  // nappe.
  const Interval before = both(ends, {-infinity, second});
  return before.leave > before.enter ? before : both(ends, {first, infinity});
}

Interval in_box(const Eigen::Vector3d& o, const Eigen::Vector3d& d) {
  Interval inside{-infinity, infinity};
  for (int axis = 0; axis < 3; ++axis) inside = both(inside, slab(o[axis], d[axis], -1, 1));
  return inside;
}

}  // namespace

Interval Solid::intersect(const Eigen::Vector3d& source, const Eigen::Vector3d& direction) const {
  const Eigen::Vector3d o = unit_from_world * source;
  const Eigen::Vector3d d = unit_from_world.linear() * direction;
  const double near = -o.dot(d) / d.squaredNorm();
  const Eigen::Vector3d close = o + near * d;
  const Interval part = kind == Kind::ball      ? in_ball(close, d)
                        : kind == Kind::frustum ? in_frustum(close, d, taper)
                                                : in_box(close, d);
  return {part.enter + near, part.leave + near};
}

std::array<Eigen::Vector3d, 8> Solid::corners() const {
  const double width = kind == Kind::frustum ? std::max(1.0, taper) : 1.0;
  const double low = kind == Kind::frustum ? 0 : -1;
  std::array<Eigen::Vector3d, 8> corners;
  for (unsigned i = 0; i < 8; ++i)
    corners[i] =
        world_from_unit * Eigen::Vector3d(i & 1 ? width : -width, i & 2 ? width : -width, i & 4 ? 1 : low);
  return corners;
}

Solid sphere(const Eigen::Vector3d& centre, double radius) {
  return placed(Solid::Kind::ball, radius * Eigen::Matrix3d::Identity(), centre);
}

Solid ellipsoid(const Eigen::Vector3d& centre, const Eigen::Vector3d& semi_axes,
                const Eigen::Matrix3d& rotation) {
  return placed(Solid::Kind::ball, rotation * semi_axes.asDiagonal(), centre);
}

Solid cylinder(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius) {
  return frustum(from, to, radius, radius);
}

Solid frustum(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double from_radius, double to_radius) {
  return flat_frustum(from, to, from_radius, to_radius, (to - from).unitOrthogonal(), 1);
}

Solid flat_frustum(const Eigen::Vector3d& from, const Eigen::Vector3d& to, double from_radius,
                   double to_radius, const Eigen::Vector3d& flat_direction, double flattening) {
  const Eigen::Vector3d axis = to - from;
  const Eigen::Vector3d across = axis.cross(flat_direction).normalized();
  const Eigen::Vector3d flat = across.cross(axis).normalized();
  Eigen::Matrix3d axes;
  axes << flattening * from_radius * flat, from_radius * across, axis;
  return placed(Solid::Kind::frustum, axes, from, to_radius / from_radius);
}

Solid box(const Eigen::Vector3d& centre, const Eigen::Vector3d& half_sides, const Eigen::Matrix3d& rotation) {
  return placed(Solid::Kind::box, rotation * half_sides.asDiagonal(), centre);
}

Solid moved(const Solid& solid, const geometry::RigidTransform& a_from_b) {
  return placed(solid.kind, a_from_b.rotation * solid.world_from_unit.linear(),
                a_from_b * solid.world_from_unit.translation(), solid.taper);
}

double signed_distance(const Solid& solid, const Eigen::Vector3d& point) {
  const Eigen::Vector3d u = solid.unit_from_world * point;
  const Eigen::Matrix3d unit_by_world = solid.unit_from_world.linear();
  const auto to_wall = [&](double value, const Eigen::RowVector3d& by_unit) {
    return value / (by_unit * unit_by_world).norm();
  };
  switch (solid.kind) {
    case Solid::Kind::ball: {
      // At the centre the direction is arbitrary.
      const Eigen::Vector3d out = u.norm() > 1e-12 ? u.normalized() : Eigen::Vector3d::UnitX();
      return to_wall(u.norm() - 1, out.transpose());
    }
    case Solid::Kind::frustum: {
      const double k = solid.taper - 1, radius = u.head<2>().norm();
      const Eigen::Vector2d out =
          radius > 1e-12 ? Eigen::Vector2d(u.head<2>() / radius) : Eigen::Vector2d::UnitX();
      return std::max({to_wall(radius - 1 - k * u.z(), {out.x(), out.y(), -k}), to_wall(-u.z(), {0, 0, -1}),
                       to_wall(u.z() - 1, {0, 0, 1})});
    }
    case Solid::Kind::box: {
      double most = -infinity;
      for (int axis = 0; axis < 3; ++axis)
        most = std::max(most, to_wall(std::abs(u[axis]) - 1, Eigen::RowVector3d::Unit(axis)));
      return most;
    }
  }
  return infinity;
}

double union_length(const std::vector<Solid>& solids, const Eigen::Vector3d& source,
                    const Eigen::Vector3d& direction) {
  if (solids.size() == 1) {
    const Interval part = solids.front().intersect(source, direction);
    return part.leave - part.enter;
  }
  std::array<Interval, 16> parts;
  std::size_t count = 0;
  for (const Solid& solid : solids) {
    const Interval part = solid.intersect(source, direction);
    if (part.leave > part.enter) parts.at(count++) = part;
  }
  const auto last = parts.begin() + static_cast<std::ptrdiff_t>(count);
  std::sort(parts.begin(), last, [](const Interval& a, const Interval& b) { return a.enter < b.enter; });
  double length = 0;
  double reached = -infinity;
  for (auto part = parts.begin(); part != last; ++part) {
    if (part->leave <= reached) continue;
    length += part->leave - std::max(part->enter, reached);
    reached = part->leave;
  }
  return length;
}

}  // namespace helicarm::simulation
