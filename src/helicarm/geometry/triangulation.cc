// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/triangulation.h"

#include <algorithm>
#include <numbers>
#include <optional>
#include <vector>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/least_squares.h"
#include "helicarm/geometry/ray.h"

namespace helicarm::geometry {
namespace {

constexpr double least_angle_deg = 1;
constexpr double farthest_mm = 1e5;      // from a source: beyond any room
constexpr double least_sigma_px = 1e-6;  // an exact pixel still needs a finite weight

constexpr double degrees(double radians) { return radians * 180 / std::numbers::pi; }

double largest_gap(std::span<const RayObservation> ray_observations) {
  double largest = 0;
  for (std::size_t i = 0; i < ray_observations.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      largest =
          std::max(largest, gap_between(ray_through(ray_observations[i].view, ray_observations[i].pixel),
                                        ray_through(ray_observations[j].view, ray_observations[j].pixel)));
  return largest;
}

Expected<void> check_place(std::span<const RayObservation> ray_observations, const Eigen::Vector3d& point) {
  for (std::size_t i = 0; i < ray_observations.size(); ++i) {
    const View& view = ray_observations[i].view;
    const double distance = (point - view.source_in_world()).norm();
    if (!(distance < farthest_mm))
      return fail(
          Reason::point_at_infinity,
          fmt::format("the rays intersect {:.3g} mm from the source, limit {:g} mm", distance, farthest_mm),
          {{"distance_mm", distance}});
    if (!(view.depth(point) > 0))
      return fail(Reason::behind_source, "the rays intersect behind a source",
                  {{"depth_mm", view.depth(point)}, {"view_index", double(i)}});
  }
  return {};
}

}  // namespace

Expected<Eigen::Vector3d> intersect_linear(std::span<const Projection> projections,
                                           std::span<const Eigen::Vector2d> pixels) {
  Eigen::MatrixXd left(2 * Eigen::Index(projections.size()), 3);
  Eigen::VectorXd right(left.rows());
  for (std::size_t i = 0; i < projections.size(); ++i)
    for (Eigen::Index axis = 0; axis < 2; ++axis) {
      const Eigen::RowVector4d equation = pixels[i](axis) * projections[i].row(2) - projections[i].row(axis);
      left.row(2 * Eigen::Index(i) + axis) = equation.head<3>();
      right(2 * Eigen::Index(i) + axis) = -equation(3);
    }
  const LinearLeastSquares fit = linear_least_squares(left, right);
  if (projections.size() < 2 || fit.rank < 3)
    return fail(Reason::parallel_rays, "the rays do not determine a point", {{"rank", double(fit.rank)}});
  return Eigen::Vector3d(fit.solution);
}

Eigen::Matrix<double, 2, 3> projection_jacobian(const View& view, const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector3d p = view.camera_from_world * point_in_world;
  const Intrinsics& k = view.intrinsics;
  Eigen::Matrix<double, 2, 3> by_camera;
  by_camera << k.fx, k.skew, -(k.fx * p.x() + k.skew * p.y()) / p.z(),  //
      0, k.fy, -k.fy * p.y() / p.z();
  return by_camera / p.z() * view.camera_from_world.rotation;
}

double widest_angle(std::span<const RayObservation> ray_observations) {
  double widest = 0;
  for (std::size_t i = 0; i < ray_observations.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      widest =
          std::max(widest, angle_between(ray_through(ray_observations[i].view, ray_observations[i].pixel),
                                         ray_through(ray_observations[j].view, ray_observations[j].pixel)));
  return widest;
}

Expected<Intersection> intersect(std::span<const RayObservation> ray_observations,
                                 const Eigen::MatrixXd& covariance_px2) {
  const auto n = Eigen::Index(ray_observations.size());
  if (n < 2)
    return fail(Reason::not_seen, "the point is marked in fewer than two views", {{"views", double(n)}});
  const double angle_deg = degrees(widest_angle(ray_observations));
  if (!(angle_deg >= least_angle_deg))
    return fail(Reason::parallel_rays,
                fmt::format("the rays are {:.3g} degrees apart, at least {:g} are required", angle_deg,
                            least_angle_deg),
                {{"angle_deg", angle_deg}});
  std::vector<Projection> projections;
  std::vector<Eigen::Vector2d> pixels;
  for (const RayObservation& sight : ray_observations) {
    projections.push_back(sight.view.projection());
    pixels.push_back(sight.pixel);
  }
  auto start = intersect_linear(projections, pixels);
  if (!start) return tl::unexpected<Failure>(start.error());
  if (auto placed = check_place(ray_observations, *start); !placed)
    return tl::unexpected<Failure>(placed.error());

  Eigen::MatrixXd covariance = covariance_px2;
  covariance.diagonal().array() += least_sigma_px * least_sigma_px;
  const auto whitens = whitening(covariance);
  if (!whitens) return fail(Reason::bad_value, "the covariance of the pixels is not positive definite");
  Eigen::MatrixX3d jacobian(2 * n, 3);
  Eigen::VectorXd residual(2 * n);
  const auto linearise = [&](const Eigen::Vector3d& point) -> std::optional<NormalEquations<3>> {
    if (!check_place(ray_observations, point)) return std::nullopt;
    for (Eigen::Index k = 0; k < n; ++k) {
      const RayObservation& ray = ray_observations[std::size_t(k)];
      jacobian.middleRows<2>(2 * k) = projection_jacobian(ray.view, point);
      residual.segment<2>(2 * k) = ray.pixel - ray.view.project(point);
    }
    jacobian = whitens->lazyProduct(jacobian).eval();
    residual = whitens->lazyProduct(residual).eval();
    return NormalEquations<3>{jacobian.transpose().lazyProduct(jacobian),
                              jacobian.transpose().lazyProduct(residual), residual.squaredNorm()};
  };
  const auto fit = fit_least_squares(
      *start, linearise,
      [](const Eigen::Vector3d& point, const Eigen::Vector3d& step) { return point + step; });
  if (!fit->converged)
    return fail(Reason::point_at_infinity, "the intersection of the rays does not converge");
  Intersection result{fit->state, fit->equations.information.inverse(), largest_gap(ray_observations),
                      fit->equations.chi2};
  linearise(result.point);  // the last trial may have been rejected: its Jacobian is of another point
  result.by_pixels = result.covariance.lazyProduct(jacobian.transpose()).lazyProduct(*whitens);
  return result;
}

}  // namespace helicarm::geometry
