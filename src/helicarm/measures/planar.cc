// SPDX-License-Identifier: Apache-2.0
#include "helicarm/measures/planar.h"

#include <cmath>
#include <numbers>

#include <Eigen/Core>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::measures {
namespace {

using Eigen::Vector2d;

double cross(const Vector2d& a, const Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

constexpr double in_degrees = 180 / std::numbers::pi;

/// Kasa's fit: x^2 + y^2 = 2 cx x + 2 cy y + c, about the points' mean.
std::optional<Circle> algebraic_circle(std::span<const Vector2d> points) {
  Vector2d mean = Vector2d::Zero();
  for (const Vector2d& point : points) mean += point / double(points.size());
  Eigen::MatrixXd design(points.size(), 3);
  Eigen::VectorXd right(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Vector2d p = points[i] - mean;
    design.row(Eigen::Index(i)) << 2 * p.x(), 2 * p.y(), 1;
    right[Eigen::Index(i)] = p.squaredNorm();
  }
  const auto solved = geometry::linear_least_squares(design, right);
  if (solved.rank < 3 || !(solved.last_pivot > 1e-9)) return std::nullopt;
  const Eigen::Vector3d found = solved.solution;
  const double square = found[2] + found.head<2>().squaredNorm();
  if (!(square > 0)) return std::nullopt;
  return Circle{mean + found.head<2>(), std::sqrt(square), 0};
}

/// Gauss-Newton step of the circle and the rms of the residuals before it; nothing where it is singular.
std::optional<Eigen::Vector3d> step_of(Circle& circle, std::span<const Vector2d> points) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  double sum = 0;
  for (const Vector2d& point : points) {
    const Vector2d from_centre = point - circle.centre;
    const double distance = from_centre.norm(), residual = distance - circle.radius;
    if (!(distance > 0)) return std::nullopt;
    const Eigen::Vector3d by(from_centre.x() / distance, from_centre.y() / distance, 1);
    information += by * by.transpose();
    gradient += by * residual;
    sum += residual * residual;
  }
  circle.residual_rms = std::sqrt(sum / double(points.size()));
  const geometry::SpdSolution solved = geometry::solve_spd(information, gradient);
  constexpr double least_condition = 1e-12;
  if (!(solved.rcond > least_condition)) return std::nullopt;
  return solved.solution;
}

}  // namespace

double angle_deg(const Vector2d& first, const Vector2d& vertex, const Vector2d& second) {
  const Vector2d a = first - vertex, b = second - vertex;
  return in_degrees * std::atan2(std::abs(cross(a, b)), a.dot(b));
}

double line_angle_deg(const Vector2d& one, const Vector2d& other) {
  return in_degrees * std::atan2(std::abs(cross(one, other)), std::abs(one.dot(other)));
}

std::optional<Circle> fit_circle(std::span<const Vector2d> points) {
  if (points.size() < 3) return std::nullopt;
  auto circle = algebraic_circle(points);
  constexpr int most_steps = 50;
  for (int i = 0; circle && i < most_steps; ++i) {
    const auto step = step_of(*circle, points);
    if (!step || !step->allFinite()) return std::nullopt;
    circle->centre += step->head<2>();
    circle->radius += (*step)[2];
    if (step->norm() < 1e-12 * circle->radius) break;
  }
  return circle;
}

double percent_along(const Vector2d& point, const Vector2d& zero, const Vector2d& hundred,
                     const Vector2d& direction) {
  return 100 * (point - zero).dot(direction) / (hundred - zero).dot(direction);
}

double percent_across(const Vector2d& point, const Vector2d& on_line, const Vector2d& direction,
                      const Vector2d& hundred) {
  return 100 * cross(direction, point - on_line) / cross(direction, hundred - on_line);
}

Eigen::MatrixXd propagated(const std::function<Eigen::VectorXd(const PlanarPoints&)>& f, PlanarPoints points,
                           std::span<const Eigen::Matrix2d> covariances) {
  const Eigen::Index size = f(points).size();
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (covariances[i].isZero(0)) continue;
    const double step = 1e-3 * std::sqrt(covariances[i].trace());
    Eigen::MatrixX2d by(size, 2);
    for (int axis = 0; axis < 2; ++axis) {
      const double at = points[i][axis];
      points[i][axis] = at + step;
      const Eigen::VectorXd above = f(points);
      points[i][axis] = at - step;
      by.col(axis) = (above - f(points)) / (2 * step);
      points[i][axis] = at;
    }
    covariance += by * covariances[i] * by.transpose();
  }
  return covariance;
}

}  // namespace helicarm::measures
