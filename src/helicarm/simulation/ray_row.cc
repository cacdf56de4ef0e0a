// SPDX-License-Identifier: Apache-2.0
#include "helicarm/simulation/ray_row.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace helicarm::simulation {
namespace {

// The loops below are Solid::intersect without branches, so that the compiler vectorises them.

void row_in_ball(const Solid& solid, const RayRow& rays, const RayRange& range, double* enter,
                 double* leave) {
  const Eigen::Matrix3d m = solid.unit_from_world.linear();
  const Eigen::Vector3d o = solid.unit_from_world * rays.source;
  for (std::size_t i = range.first; i < range.last; ++i) {
    const double dx = m(0, 0) * rays.x[i] + m(0, 1) * rays.y[i] + m(0, 2) * rays.z[i];
    const double dy = m(1, 0) * rays.x[i] + m(1, 1) * rays.y[i] + m(1, 2) * rays.z[i];
    const double dz = m(2, 0) * rays.x[i] + m(2, 1) * rays.y[i] + m(2, 2) * rays.z[i];
    const double a = dx * dx + dy * dy + dz * dz;
    const double middle = -(o.x() * dx + o.y() * dy + o.z() * dz) / a;
    const double px = o.x() + middle * dx;
    const double py = o.y() + middle * dy;
    const double pz = o.z() + middle * dz;
    const double left = 1 - (px * px + py * py + pz * pz);
    const double half = std::sqrt((left > 0 ? left : 0) / a);
    enter[i] = middle - half;
    leave[i] = middle + half;
  }
}

/// False if a ray is parallel to the wall or an end: these need the scalar path.
bool row_in_frustum(const Solid& solid, const RayRow& rays, const RayRange& range, double* enter,
                    double* leave) {
  const Eigen::Matrix3d m = solid.unit_from_world.linear();
  const Eigen::Vector3d o = solid.unit_from_world * rays.source;
  const double k = solid.taper - 1;
  long odd = 0;
  for (std::size_t i = range.first; i < range.last; ++i) {
    const double dx = m(0, 0) * rays.x[i] + m(0, 1) * rays.y[i] + m(0, 2) * rays.z[i];
    const double dy = m(1, 0) * rays.x[i] + m(1, 1) * rays.y[i] + m(1, 2) * rays.z[i];
    const double dz = m(2, 0) * rays.x[i] + m(2, 1) * rays.y[i] + m(2, 2) * rays.z[i];
    const double dd = dx * dx + dy * dy + dz * dz;
    const double near = -(o.x() * dx + o.y() * dy + o.z() * dz) / dd;
    const double x = o.x() + near * dx;
    const double y = o.y() + near * dy;
    const double z = o.z() + near * dz;
    const double bottom = -z / dz;
    const double top = (1 - z) / dz;
    const double low = bottom < top ? bottom : top;
    const double high = bottom < top ? top : bottom;
    const double radius = 1 + k * z;
    const double a = dx * dx + dy * dy - k * k * dz * dz;
    const double b = x * dx + y * dy - k * dz * radius;
    const double c = x * x + y * y - radius * radius;
    const double discriminant = b * b - a * c;
    const double root = std::sqrt(discriminant > 0 ? discriminant : 0);
    const double first = (-b - root) / a;
    const double second = (-b + root) / a;
    // a > 0: between the roots. a < 0 (steeper than the wall): before the first or after the second, or all.
    const double until = high < second ? high : second;
    const double since = low > first ? low : first;
    const bool steep = a < 0;
    const bool misses = discriminant <= 0;
    const bool before = until > low;
    const double steep_enter = misses || before ? low : since;
    const double steep_leave = misses || !before ? high : until;
    const double from = steep ? steep_enter : since;
    const double to = steep ? steep_leave : until;
    const bool hit = to > from && (steep || !misses);
    enter[i] = hit ? near + from : 0;
    leave[i] = hit ? near + to : 0;
    odd |= std::abs(a) < 1e-14 * dd || std::abs(dz) < 1e-300 ? 1L : 0L;
  }
  return odd == 0;
}

void row_in_solid(const Solid& solid, const RayRow& rays, const RayRange& range, double* enter,
                  double* leave) {
  if (solid.kind == Solid::Kind::ball) return row_in_ball(solid, rays, range, enter, leave);
  if (solid.kind == Solid::Kind::frustum && row_in_frustum(solid, rays, range, enter, leave)) return;
  for (std::size_t i = range.first; i < range.last; ++i) {
    const Interval part = solid.intersect(rays.source, rays.direction(i));
    enter[i] = part.leave > part.enter ? part.enter : 0;
    leave[i] = part.leave > part.enter ? part.leave : 0;
  }
}

/// Orders two rows of intervals by their starts, ray by ray.
void order(std::size_t count, double* enter_a, double* leave_a, double* enter_b, double* leave_b) {
  for (std::size_t i = 0; i < count; ++i) {
    const bool swap = enter_a[i] > enter_b[i];
    const double enter = enter_a[i];
    const double leave = leave_a[i];
    enter_a[i] = swap ? enter_b[i] : enter;
    leave_a[i] = swap ? leave_b[i] : leave;
    enter_b[i] = swap ? enter : enter_b[i];
    leave_b[i] = swap ? leave : leave_b[i];
  }
}

}  // namespace

void union_lengths(const std::vector<Solid>& solids, const RayRow& rays, const RayRange& range,
                   const std::vector<RayRange>& of_solid, double* path) {
  const std::size_t count = range.last - range.first;
  std::vector<double> intervals(2 * solids.size() * count);  // 0, 0: none
  const auto enter = [&](std::size_t s) { return intervals.data() + 2 * s * count; };
  const auto leave = [&](std::size_t s) { return enter(s) + count; };
  for (std::size_t s = 0; s < solids.size(); ++s)
    row_in_solid(solids[s], rays, of_solid[s], enter(s) - range.first, leave(s) - range.first);
  for (std::size_t end = solids.size(); end > 1; --end)
    for (std::size_t s = 0; s + 1 < end; ++s) order(count, enter(s), leave(s), enter(s + 1), leave(s + 1));

  std::vector<double> reached(count, -std::numeric_limits<double>::infinity());
  std::fill(path + range.first, path + range.last, 0.0);
  for (std::size_t s = 0; s < solids.size(); ++s) {
    const double* in = enter(s);
    const double* out = leave(s);
    for (std::size_t i = 0; i < count; ++i) {
      const double from = in[i] > reached[i] ? in[i] : reached[i];
      path[range.first + i] += out[i] > from ? out[i] - from : 0;
      reached[i] = out[i] > reached[i] ? out[i] : reached[i];
    }
  }
}

}  // namespace helicarm::simulation
