// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom/rules.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <tuple>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/phantom/conical_helix.h"

namespace helicarm::phantom {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double degree = std::numbers::pi / 180;

using Points = std::vector<Eigen::Vector3d>;

/// Balls P1..P12 in that order; empty if a label is missing.
Points numbered(const Calibrator& calibrator) {
  std::map<std::string, Eigen::Vector3d> places;
  for (const auto& ball : calibrator.balls) places[ball.label] = ball.centre_in_calibrator;
  Points points;
  for (int i = 1; i <= 12; ++i) {
    const auto found = places.find(fmt::format("P{}", i));
    if (found == places.end()) return {};
    points.push_back(found->second);
  }
  return points;
}

/// `numbers` as in the paper, from 1.
Points pick(const Points& points, std::initializer_list<std::size_t> numbers) {
  Points picked;
  for (const std::size_t number : numbers) picked.push_back(points[number - 1]);
  return picked;
}

/// Largest distance from the best plane (2 dimensions) or the best line (1).
double misfit_mm(const Points& points, int dimensions) {
  Eigen::Matrix3Xd spread(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i) spread.col(static_cast<Eigen::Index>(i)) = points[i];
  spread.colwise() -= spread.rowwise().mean().eval();
  const Eigen::MatrixXd axes = geometry::symmetric_eigen(spread * spread.transpose()).vectors;
  return (axes.leftCols(3 - dimensions).transpose() * spread).colwise().norm().maxCoeff();
}

double middle_to_chord_mm(const Points& three) {
  return Eigen::ParametrizedLine<double, 3>::Through(three[0], three[2]).distance(three[1]);
}

double distance_to_helix_mm(const ConicalHelix& helix, const Eigen::Vector3d& point) {
  const auto distance = [&](double t) {
    return (helix.point(std::clamp(t, 0.0, helix.t_end)) - point).norm();
  };
  double best = std::clamp(point.z() / helix.h, 0.0, helix.t_end);
  for (double step = std::numbers::pi / 8; step > 1e-9; step /= 2) {
    const double centre = best;
    for (int i = -8; i <= 8; ++i)
      if (distance(centre + i * step) < distance(best)) best = centre + i * step;
  }
  return distance(best);
}

/// The conical helix about z nearest to balls P1..P12 in that order, less than half a turn apart.
ConicalHelix fitted_helix(const Points& balls) {
  const auto count = static_cast<Eigen::Index>(balls.size());
  Eigen::VectorXd angle(count), height(count), log_radius(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Vector3d& ball = balls[static_cast<std::size_t>(i)];
    height(i) = ball.z();
    log_radius(i) = std::log(std::max(ball.head<2>().norm(), 1e-3));
    angle(i) = std::atan2(ball.y(), ball.x());
    if (i > 0) angle(i) = angle(i - 1) + std::remainder(angle(i) - angle(i - 1), 2 * std::numbers::pi);
  }
  ConicalHelix helix;
  double least = infinity;
  Eigen::VectorXd t;
  for (int turns = 0; turns <= 2; ++turns) {
    const Eigen::VectorXd from_base = angle.array() + 2 * std::numbers::pi * turns;
    const double rise = from_base.dot(height) / from_base.squaredNorm();
    const double misfit = (height - rise * from_base).norm();
    if (!(misfit < least)) continue;
    least = misfit;
    helix.h = rise;
    t = from_base;
  }
  const Eigen::VectorXd spread = t.array() - t.mean();
  const double slope = spread.dot(log_radius) / spread.squaredNorm();
  helix.pp = -1 / slope;
  helix.rr = std::exp(log_radius.mean() - slope * t.mean());
  helix.t_end = std::max(helix.t_end, t.maxCoeff());
  return helix;
}

double imaged(const Calibrator& calibrator, const geometry::View& view, const RuleOptions& options) {
  return double(
      std::count_if(calibrator.balls.begin(), calibrator.balls.end(), [&](const CalibratorBall& ball) {
        const double radius =
            ball.diameter_mm / 2 * options.source_detector_mm / view.depth(ball.centre_in_calibrator);
        return view.project(ball.centre_in_calibrator).norm() + radius <= options.field_mm / 2;
      }));
}

/// Smallest turning angle (degrees) at a corner of the quadrilateral, in the majority's sense; not positive
/// if it is not convex.
double least_turn_deg(const geometry::View& view, const Points& corners) {
  std::array<double, 4> turns{};
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2d at = view.project(corners[(i + 1) % 4]);
    const Eigen::Vector2d in = at - view.project(corners[i]);
    const Eigen::Vector2d out = view.project(corners[(i + 2) % 4]) - at;
    turns[i] = std::atan2(in.x() * out.y() - in.y() * out.x(), in.dot(out)) / degree;
  }
  const auto [low, high] = std::minmax_element(turns.begin(), turns.end());
  return std::max(*low, -*high);
}

void check_space(const Calibrator& calibrator, const DesignViews& views, const RuleOptions& options,
                 std::vector<RuleFinding>& findings) {
  const auto add = [&](auto... fields) { findings.push_back({fields...}); };
  add("targets_inside", "the target region lies inside the balls' convex hull",
      depth_in_hull_mm(calibrator, middle_of(calibrator)) - options.target_radius_mm, Bound::at_least, 0.0,
      "mm");
  add("ball_count", "fewer than 20 balls", double(calibrator.balls.size()), Bound::at_most, 19.0, "balls");
  add("imaged_ap", "at least 6 balls in the AP image", imaged(calibrator, views.ap, options), Bound::at_least,
      6.0, "balls");
  add("imaged_lateral", "at least 6 balls in the lateral image", imaged(calibrator, views.lateral, options),
      Bound::at_least, 6.0, "balls");
  for (const double range_deg : {0.0, options.range_deg}) {
    const std::string turned = range_deg > 0 ? fmt::format(", rotated by up to {} degrees", range_deg) : "";
    const std::string suffix = range_deg > 0 ? "_turned" : "";
    for (const auto& [rule, image, view] :
         {std::tuple{"gap_ap", "AP", &views.ap}, {"gap_lateral", "lateral", &views.lateral}}) {
      const BallGap gap = smallest_gap(calibrator, *view, range_deg);
      add(rule + suffix, fmt::format("no balls overlap in the {} image{}", image, turned), gap.gap_mm,
          Bound::at_least, 0.0, "mm", gap.gap_mm < 0 ? gap.a + " and " + gap.b : "");
    }
  }
}

void check_helical(const Points& balls, const DesignViews& views, std::vector<RuleFinding>& findings) {
  const auto add = [&](auto... fields) { findings.push_back({fields...}); };
  const ConicalHelix helix = fitted_helix(balls);
  double off_helix = 0;
  for (const auto& ball : balls) off_helix = std::max(off_helix, distance_to_helix_mm(helix, ball));
  add("on_helix", "all balls are on one conical helix", off_helix, Bound::at_most, 0.05, "mm");
  add("first_plane", "P1 P2 P5 P6 P9 P10 are on one plane", misfit_mm(pick(balls, {1, 2, 5, 6, 9, 10}), 2),
      Bound::at_most, 0.5, "mm");
  add("second_plane", "P3 P4 P7 P8 P11 P12 are on one plane", misfit_mm(pick(balls, {3, 4, 7, 8, 11, 12}), 2),
      Bound::at_most, 0.5, "mm");
  for (std::size_t k = 1; k <= 4; ++k) {
    const Points three = pick(balls, {k, k + 4, k + 8});
    const std::string names = fmt::format("P{} P{} P{}", k, k + 4, k + 8);
    add(fmt::format("line_{}", k), names + " are on one line", misfit_mm(three, 1), Bound::at_most, 1.0,
        "mm");
    add(fmt::format("chord_{}", k), names + ": the middle ball is on the chord", middle_to_chord_mm(three),
        Bound::at_most, 1.0, "mm");
  }
  for (std::size_t k = 1; k <= 9; k += 4) {
    const Points four = pick(balls, {k, k + 1, k + 2, k + 3});
    const std::string sentence =
        fmt::format("P{} to P{} are the corners of a convex quadrilateral in the ", k, k + 3);
    add(fmt::format("convex_ap_{}", k), sentence + "AP image", least_turn_deg(views.ap, four),
        Bound::at_least, 0.0, "deg");
    add(fmt::format("convex_lateral_{}", k), sentence + "lateral image", least_turn_deg(views.lateral, four),
        Bound::at_least, 0.0, "deg");
  }
}

}  // namespace

DesignViews design_views(const Calibrator& calibrator, const RuleOptions& options) {
  const auto view = [&](const Eigen::Matrix3d& rotation) {
    const double f = options.source_detector_mm;
    return geometry::View{
        {f, f, 0, 0, 0},
        {rotation, Eigen::Vector3d(0, 0, options.source_calibrator_mm) - rotation * middle_of(calibrator)}};
  };
  return {view(Eigen::Matrix3d::Identity()),
          view((Eigen::Matrix3d() << 1, 0, 0, 0, 0, 1, 0, -1, 0).finished())};
}

BallGap smallest_gap(const Calibrator& calibrator, const geometry::View& view, double range_deg) {
  const Eigen::Vector3d middle = view.camera_from_world * middle_of(calibrator);
  const int steps = range_deg > 0 ? 5 : 0;
  BallGap smallest{{}, {}, infinity};
  for (int i = -steps; i <= steps; ++i)
    for (int j = -steps; j <= steps; ++j) {
      const Eigen::Matrix3d turn = (Eigen::AngleAxisd(i * range_deg / 5 * degree, Eigen::Vector3d::UnitX()) *
                                    Eigen::AngleAxisd(j * range_deg / 5 * degree, Eigen::Vector3d::UnitY()))
                                       .toRotationMatrix();
      Points rays;
      std::vector<double> half_angles;
      for (const auto& ball : calibrator.balls) {
        rays.push_back(middle + turn * (view.camera_from_world * ball.centre_in_calibrator - middle));
        half_angles.push_back(std::asin(ball.diameter_mm / 2 / rays.back().norm()));
      }
      for (std::size_t a = 0; a < rays.size(); ++a)
        for (std::size_t b = 0; b < a; ++b) {
          const double angle = std::atan2(rays[a].cross(rays[b]).norm(), rays[a].dot(rays[b]));
          const double gap = (angle - half_angles[a] - half_angles[b]) * middle.z();
          if (gap < smallest.gap_mm) smallest = {calibrator.balls[b].label, calibrator.balls[a].label, gap};
        }
    }
  return smallest;
}

double depth_in_hull_mm(const Calibrator& calibrator, const Eigen::Vector3d& point) {
  const auto& balls = calibrator.balls;
  double depth = infinity;
  for (std::size_t i = 0; i < balls.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      for (std::size_t k = 0; k < j; ++k) {
        const Eigen::Vector3d& corner = balls[i].centre_in_calibrator;
        Eigen::Vector3d normal =
            (balls[j].centre_in_calibrator - corner).cross(balls[k].centre_in_calibrator - corner);
        if (normal.norm() < 1e-9) continue;
        normal.normalize();
        const auto height = [&](const Eigen::Vector3d& p) { return normal.dot(p - corner); };
        for (const double side : {1.0, -1.0})
          if (std::all_of(balls.begin(), balls.end(), [&](const CalibratorBall& ball) {
                return side * height(ball.centre_in_calibrator) > -1e-9;
              }))
            depth = std::min(depth, side * height(point));
      }
  return depth;
}

std::vector<RuleFinding> check_rules(const Calibrator& calibrator, const RuleOptions& options) {
  std::vector<RuleFinding> findings;
  const DesignViews views = design_views(calibrator, options);
  check_space(calibrator, views, options, findings);
  const Points balls = numbered(calibrator);
  if (!balls.empty()) check_helical(balls, views, findings);
  return findings;
}

}  // namespace helicarm::phantom
