// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/phantom_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <Eigen/Geometry>

#include "helicarm/core/parallel.h"
#include "helicarm/fiducials/label.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::fiducials {
namespace {

using Ball = phantom::CalibratorBall;

/// Points of a Fibonacci lattice on the sphere.
Eigen::Vector3d direction(std::size_t index, std::size_t count) {
  const double z = 1 - (2 * double(index) + 1) / double(count);
  const double azimuth = std::numbers::pi * (3 - std::sqrt(5.0)) * double(index);
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(azimuth), r * std::sin(azimuth), z};
}

geometry::View view_along(const phantom::Calibrator& calibrator, const Eigen::Vector3d& beam,
                          const PhantomCheckOptions& options) {
  const double focal = options.source_detector_mm / options.pixel_mm, middle = 0.5 * (options.size_px - 1);
  const Eigen::Matrix3d rotation = geometry::rotation_between(beam, Eigen::Vector3d::UnitZ());
  return {{focal, focal, middle, middle, 0},
          {rotation,
           Eigen::Vector3d(0, 0, options.source_calibrator_mm) - rotation * phantom::middle_of(calibrator)}};
}

double radius_px(const Ball& ball, const geometry::View& view) {
  return 0.5 * ball.diameter_mm * view.intrinsics.fy / view.depth(ball.centre_in_calibrator);
}

bool overlap(const Ball& a, const Ball& b, const geometry::View& view) {
  const double apart = (view.project(a.centre_in_calibrator) - view.project(b.centre_in_calibrator)).norm();
  return apart < radius_px(a, view) + radius_px(b, view);
}

/// Pairs of balls (indices) whose images overlap.
std::vector<std::pair<std::size_t, std::size_t>> overlaps(const std::vector<Ball>& balls,
                                                          const geometry::View& view) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t i = 0; i < balls.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (overlap(balls[i], balls[j], view)) pairs.emplace_back(j, i);
  return pairs;
}

SeenDirection seen_along(const phantom::Calibrator& calibrator, const geometry::View& view,
                         const std::vector<std::pair<std::size_t, std::size_t>>& pairs,
                         const PhantomCheckOptions& options) {
  constexpr double radius_share = 0.02;
  std::vector<bool> behind(calibrator.balls.size(), false);
  for (const auto& [a, b] : pairs) {
    const bool b_is_nearer = view.depth(calibrator.balls[b].centre_in_calibrator) <
                             view.depth(calibrator.balls[a].centre_in_calibrator);
    behind[b_is_nearer ? a : b] = true;
  }
  const double half = 0.5 * options.size_px;
  std::vector<BallCandidate> candidates;
  for (std::size_t i = 0; i < behind.size(); ++i) {
    const Ball& ball = calibrator.balls[i];
    const Eigen::Vector2d uv = view.project(ball.centre_in_calibrator);
    if (behind[i] || (uv.array() - half).matrix().norm() > half) continue;
    const double radius = radius_px(ball, view);
    candidates.push_back({uv, options.sigma_px, radius, radius_share * radius});
  }
  const LabellingPrior prior{.focal_px = view.intrinsics.fx,
                             .principal_px = {view.intrinsics.u0, view.intrinsics.v0},
                             .field_radius_px = half};
  SeenDirection seen;
  const auto labels = label_balls(calibrator, candidates, prior);
  if (labels) {
    seen.margin = labels->margin;
  } else {
    seen.refused = labels.error();
    seen.mirror =
        labels.error().figures.count("mirror_differs") && labels.error().figures.at("mirror_differs") > 0;
  }
  return seen;
}

/// Right-handed axes of a triangle, or left-handed ones.
Eigen::Matrix3d axes_of(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                        bool left_handed) {
  Eigen::Matrix3d axes;
  axes.col(0) = (b - a).normalized();
  axes.col(2) = (b - a).cross(c - a).normalized() * (left_handed ? -1 : 1);
  axes.col(1) = (b - a).cross(c - a).normalized().cross(axes.col(0));
  return axes;
}

/// Each ball's index among those of its diameter nearest to where the motion brings it; empty unless one to
/// one.
std::vector<std::size_t> nearest_after(const std::vector<Ball>& balls, const Eigen::Matrix3d& rotation,
                                       const Eigen::Vector3d& translation, double& rms_mm) {
  std::vector<std::size_t> places;
  std::vector<bool> taken(balls.size(), false);
  double squares = 0;
  for (const Ball& ball : balls) {
    const Eigen::Vector3d at = rotation * ball.centre_in_calibrator + translation;
    std::size_t best = balls.size();
    double least = INFINITY;
    for (std::size_t i = 0; i < balls.size(); ++i) {
      const double distance = (balls[i].centre_in_calibrator - at).squaredNorm();
      if (std::abs(balls[i].diameter_mm - ball.diameter_mm) < 0.2 && distance < least)
        least = distance, best = i;
    }
    if (best == balls.size() || taken[best]) return {};
    taken[best] = true;
    places.push_back(best);
    squares += least;
  }
  rms_mm = std::sqrt(squares / double(balls.size()));
  return places;
}

/// Three balls far apart.
std::array<std::size_t, 3> wide_triangle(const std::vector<Ball>& balls) {
  std::array<std::size_t, 3> best{0, 1, 2};
  double largest = -1;
  for (std::size_t i = 0; i < balls.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      for (std::size_t k = 0; k < j; ++k) {
        const Eigen::Vector3d& a = balls[i].centre_in_calibrator;
        const double area =
            (balls[j].centre_in_calibrator - a).cross(balls[k].centre_in_calibrator - a).norm();
        if (area > largest) largest = area, best = {i, j, k};
      }
  return best;
}

}  // namespace

std::size_t PhantomCheck::refused() const {
  return std::size_t(
      std::ranges::count_if(directions, [](const SeenDirection& seen) { return seen.refused.has_value(); }));
}

std::optional<NearSymmetry> near_symmetry(const phantom::Calibrator& calibrator, bool mirror,
                                          double limit_mm) {
  const std::vector<Ball>& balls = calibrator.balls;
  const auto at = [&](std::size_t i) { return balls[i].centre_in_calibrator; };
  const auto [p, q, r] = wide_triangle(balls);
  const Eigen::Matrix3d from = axes_of(at(p), at(q), at(r), false);
  const auto alike = [&](std::size_t i, std::size_t j, std::size_t k, std::size_t l) {
    return std::abs((at(i) - at(j)).norm() - (at(k) - at(l)).norm()) < 3 * limit_mm;
  };
  std::optional<NearSymmetry> best;
  for (std::size_t a = 0; a < balls.size(); ++a)
    for (std::size_t b = 0; b < balls.size(); ++b) {
      if (a == b || !alike(p, q, a, b)) continue;
      for (std::size_t c = 0; c < balls.size(); ++c) {
        if (c == a || c == b || !alike(p, r, a, c) || !alike(q, r, b, c)) continue;
        const Eigen::Matrix3d rotation = axes_of(at(a), at(b), at(c), mirror) * from.transpose();
        const Eigen::Vector3d translation =
            (at(a) + at(b) + at(c)) / 3 - rotation * (at(p) + at(q) + at(r)) / 3;
        double rms = 0;
        const auto places = nearest_after(balls, rotation, translation, rms);
        if (places.empty() || rms > limit_mm || (best && best->rms_mm <= rms)) continue;
        NearSymmetry symmetry{mirror, rms, 0, {}};
        for (std::size_t i = 0; i < places.size(); ++i)
          if (places[i] != i) symmetry.moves.emplace_back(balls[i].label, balls[places[i]].label);
        if (symmetry.moves.empty()) continue;
        const Eigen::AngleAxisd turn(Eigen::Matrix3d(mirror ? -rotation : rotation));
        symmetry.turn_deg = turn.angle() * 180 / std::numbers::pi;
        best = std::move(symmetry);
      }
    }
  return best;
}

PhantomCheck check_phantom(const phantom::Calibrator& calibrator, const PhantomCheckOptions& options) {
  PhantomCheck check;
  check.directions.resize(options.directions);
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> pairs(options.directions);
  parallel_for(options.directions, options.threads, [&](std::size_t i) {
    const Eigen::Vector3d beam = direction(i, options.directions);
    const geometry::View view = view_along(calibrator, beam, options);
    pairs[i] = overlaps(calibrator.balls, view);
    check.directions[i] = seen_along(calibrator, view, pairs[i], options);
    check.directions[i].beam = beam;
  });
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> counts;
  for (const auto& of_direction : pairs)
    for (const auto& pair : of_direction) ++counts[pair];
  for (const auto& [pair, count] : counts)
    check.hiding.push_back({calibrator.balls[pair.first].label, calibrator.balls[pair.second].label, count});
  std::ranges::stable_sort(check.hiding, std::ranges::greater(), &HidingPair::directions);
  check.rotation = near_symmetry(calibrator, false);
  check.mirror = near_symmetry(calibrator, true);
  return check;
}

}  // namespace helicarm::fiducials
