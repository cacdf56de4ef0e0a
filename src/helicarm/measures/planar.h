// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace helicarm::measures {

using PlanarPoints = std::vector<Eigen::Vector2d>;

/// Angle at `vertex`, 0 to 180 degrees.
double angle_deg(const Eigen::Vector2d& first, const Eigen::Vector2d& vertex, const Eigen::Vector2d& second);

/// Angle between two directions taken as lines, 0 to 90 degrees.
double line_angle_deg(const Eigen::Vector2d& one, const Eigen::Vector2d& other);

struct Circle {
  Eigen::Vector2d centre;
  double radius;
  double residual_rms;  ///< of the points' distances from the circle
};

/// Least squares of the points' distances from the circle, from the algebraic fit (I. Kasa: A circle fitting
/// procedure and its error analysis, IEEE Trans Instrum Meas 25, 8-14, 1976). Nothing for fewer than three
/// points, or where their directions from the centre do not determine it (points on a line).
std::optional<Circle> fit_circle(std::span<const Eigen::Vector2d> points);

/// Per cent of `point` along the unit or other `direction` from `zero` to `hundred`.
double percent_along(const Eigen::Vector2d& point, const Eigen::Vector2d& zero,
                     const Eigen::Vector2d& hundred, const Eigen::Vector2d& direction);

/// Per cent of `point` across the line through `on_line` of this direction: 0 on it, 100 at `hundred`.
double percent_across(const Eigen::Vector2d& point, const Eigen::Vector2d& on_line,
                      const Eigen::Vector2d& direction, const Eigen::Vector2d& hundred);

/// First-order covariance of f(points) where the points' errors are independent of each other; central
/// differences over a thousandth of each point's standard deviation.
Eigen::MatrixXd propagated(const std::function<Eigen::VectorXd(const PlanarPoints&)>& f, PlanarPoints points,
                           std::span<const Eigen::Matrix2d> covariances);

}  // namespace helicarm::measures
