// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/open_body.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

namespace helicarm::phantom {
namespace {

constexpr double pocket_depth_mm = 20;
constexpr double plate_gap_mm = 6;  // between the plate and the lowest ball

double segment_distance(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& p) {
  const Eigen::Vector3d along = b - a;
  const double length2 = along.squaredNorm();
  const double share = length2 > 0 ? std::clamp((p - a).dot(along) / length2, 0.0, 1.0) : 0;
  return (p - a - share * along).norm();
}

/// Axis parallel to z through the balls' centroid.
struct Axis {
  explicit Axis(const Calibrator& calibrator) : at(middle_of(calibrator).head<2>()) {}
  double radius(const Eigen::Vector3d& p) const { return (p.head<2>() - at).norm(); }
  double azimuth(const Eigen::Vector3d& p) const { return std::atan2(p.y() - at.y(), p.x() - at.x()); }
  Eigen::Vector3d point(double azimuth, double radius, double z) const {
    return {at.x() + radius * std::cos(azimuth), at.y() + radius * std::sin(azimuth), z};
  }
  Eigen::Vector3d outward(const Eigen::Vector3d& p) const {
    return radius(p) > 1 ? Eigen::Vector3d(point(azimuth(p), 1, 0) - point(0, 0, 0))
                         : Eigen::Vector3d::UnitZ();
  }
  Eigen::Vector2d at;
};

/// Azimuth of the first of four ribs, as far as possible from all balls.
double rib_azimuth(const Calibrator& calibrator, const Axis& axis) {
  constexpr int steps = 90;
  const double quarter = std::numbers::pi / 2;
  double best = 0, widest = -1;
  for (int i = 0; i < steps; ++i) {
    const double azimuth = quarter * i / steps;
    double nearest = INFINITY;
    for (const CalibratorBall& ball : calibrator.balls) {
      const double turns = (axis.azimuth(ball.centre_in_calibrator) - azimuth) / quarter;
      nearest = std::min(nearest, std::abs(turns - std::round(turns)));
    }
    if (nearest > widest) widest = nearest, best = azimuth;
  }
  return best;
}

/// A ring through each ball, and ribs along the half sections of the rings in the order of their heights.
SignedDistance rings_distance(const Calibrator& calibrator, const BodyOptions& options) {
  const Axis axis(calibrator);
  std::vector<Eigen::Vector2d> rings;  // radius, z
  for (const CalibratorBall& ball : calibrator.balls)
    rings.emplace_back(axis.radius(ball.centre_in_calibrator), ball.centre_in_calibrator.z());
  std::ranges::sort(rings, {}, [](const Eigen::Vector2d& ring) { return ring.y(); });
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> ribs;
  const double first = rib_azimuth(calibrator, axis);
  for (int k = 0; k < 4; ++k)
    for (std::size_t i = 1; i < rings.size(); ++i) {
      const double azimuth = first + k * std::numbers::pi / 2;
      ribs.emplace_back(axis.point(azimuth, rings[i - 1].x(), rings[i - 1].y()),
                        axis.point(azimuth, rings[i].x(), rings[i].y()));
    }
  return [=](const Eigen::Vector3d& p) {
    double distance = INFINITY;
    for (const Eigen::Vector2d& ring : rings)
      distance = std::min(distance, std::hypot(axis.radius(p) - ring.x(), p.z() - ring.y()));
    for (const auto& [a, b] : ribs) distance = std::min(distance, segment_distance(a, b, p));
    return distance - options.wall_mm;
  };
}

double plate_top_mm(const Calibrator& calibrator) {
  double low = INFINITY;
  for (const CalibratorBall& ball : calibrator.balls)
    low = std::min(low, ball.centre_in_calibrator.z() - ball.diameter_mm / 2);
  return low - plate_gap_mm;
}

double post_radius(const CalibratorBall& ball, const BodyOptions& options) {
  return ball.diameter_mm / 2 + options.wall_mm;
}

/// A rectangular plate below the balls, and a post under each.
SignedDistance plate_distance(const Calibrator& calibrator, const BodyOptions& options) {
  Eigen::AlignedBox2d base;
  for (const CalibratorBall& ball : calibrator.balls) {
    const Eigen::Vector2d reach = Eigen::Vector2d::Constant(post_radius(ball, options) + options.wall_mm);
    base.extend(ball.centre_in_calibrator.head<2>() + reach);
    base.extend(ball.centre_in_calibrator.head<2>() - reach);
  }
  const double top = plate_top_mm(calibrator), thickness = 2 * options.wall_mm;
  const Eigen::Vector3d centre(base.center().x(), base.center().y(), top - thickness / 2);
  const Eigen::Vector3d half(base.sizes().x() / 2, base.sizes().y() / 2, thickness / 2);
  return [=, balls = calibrator.balls](const Eigen::Vector3d& p) {
    const Eigen::Vector3d q = (p - centre).cwiseAbs() - half;
    double distance = q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0);
    for (const CalibratorBall& ball : balls) {
      const Eigen::Vector3d& at = ball.centre_in_calibrator;
      const double beside = (p - at).head<2>().norm() - post_radius(ball, options);
      distance = std::min(distance, std::max({beside, p.z() - at.z(), top - thickness / 2 - p.z()}));
    }
    return distance;
  };
}

}  // namespace

double pocket_distance(const CalibratorBall& ball, const Eigen::Vector3d& outward, double clearance_mm,
                       const Eigen::Vector3d& point) {
  const Eigen::Vector3d from = point - ball.centre_in_calibrator;
  return (from - outward * std::clamp(from.dot(outward), 0.0, pocket_depth_mm)).norm() -
         (ball.diameter_mm + clearance_mm) / 2;
}

SignedDistance open_body_distance(const Calibrator& calibrator, const BodyOptions& options) {
  const bool rings = options.shape == BodyShape::rings;
  const Axis axis(calibrator);
  return [=, balls = calibrator.balls,
          frame = rings ? rings_distance(calibrator, options)
                        : plate_distance(calibrator, options)](const Eigen::Vector3d& p) {
    double distance = frame(p);
    if (rings)
      for (const CalibratorBall& ball : balls)
        distance = std::min(distance, (p - ball.centre_in_calibrator).norm() - post_radius(ball, options));
    for (const CalibratorBall& ball : balls)
      distance = std::max(
          distance,
          -pocket_distance(ball, rings ? axis.outward(ball.centre_in_calibrator) : Eigen::Vector3d::UnitZ(),
                           options.clearance_mm, p));
    return distance;
  };
}

Eigen::AlignedBox3d open_body_box(const Calibrator& calibrator, const BodyOptions& options) {
  Eigen::AlignedBox3d box;
  const Axis axis(calibrator);
  for (const CalibratorBall& ball : calibrator.balls) {
    const Eigen::Vector3d& at = ball.centre_in_calibrator;
    const double wide = post_radius(ball, options) + options.wall_mm;
    const double ring = options.shape == BodyShape::rings ? axis.radius(at) : 0;
    const Eigen::Vector3d middle = ring > 0 ? axis.point(0, 0, at.z()) : at;
    const Eigen::Vector3d reach(ring + wide, ring + wide, wide);
    box.extend(middle + reach);
    box.extend(middle - reach);
  }
  if (options.shape == BodyShape::plate) box.min().z() = plate_top_mm(calibrator) - 2 * options.wall_mm;
  const Eigen::Vector3d margin = Eigen::Vector3d::Constant(2 * options.step_mm);
  return {box.min() - margin, box.max() + margin};
}

Expected<void> check_pockets(const Calibrator& calibrator, const BodyOptions& options) {
  const Axis axis(calibrator);
  for (const CalibratorBall& pocketed : calibrator.balls)
    for (const CalibratorBall& seated : calibrator.balls) {
      if (&pocketed == &seated) continue;
      const double apart = pocket_distance(pocketed, axis.outward(pocketed.centre_in_calibrator),
                                           options.clearance_mm, seated.centre_in_calibrator);
      if (apart < seated.diameter_mm / 2)
        return fail(
            Reason::bad_value,
            fmt::format("{}: the pocket of {} passes {} within {:.1f} mm of its centre, at least {:.1f} "
                        "mm are needed: choose --body plate, or move a ball",
                        calibrator.name, pocketed.label, seated.label, apart, seated.diameter_mm / 2),
            {{"apart_mm", apart}, {"needed_mm", seated.diameter_mm / 2}});
    }
  return {};
}

Expected<void> check_posts(const Calibrator& calibrator, const BodyOptions& options) {
  for (const CalibratorBall& upper : calibrator.balls)
    for (const CalibratorBall& lower : calibrator.balls) {
      const Eigen::Vector3d apart = upper.centre_in_calibrator - lower.centre_in_calibrator;
      if (&upper == &lower || apart.z() < 0) continue;
      const double needed = post_radius(upper, options) + lower.diameter_mm / 2;
      if (apart.head<2>().norm() < needed)
        return fail(Reason::bad_value,
                    fmt::format("{}: the post of {} passes {}, {:.1f} mm beside it, at least {:.1f} mm are "
                                "needed: choose --body rings",
                                calibrator.name, upper.label, lower.label, apart.head<2>().norm(), needed),
                    {{"apart_mm", apart.head<2>().norm()}, {"needed_mm", needed}});
    }
  return {};
}

}  // namespace helicarm::phantom
