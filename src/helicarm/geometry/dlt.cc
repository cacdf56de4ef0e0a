// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/dlt.h"

#include <cmath>
#include <limits>

#include <Eigen/LU>
#include <fmt/format.h>

#include "helicarm/geometry/decomposition.h"
#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::geometry {
namespace {

constexpr double largest_condition = 1e3;  // thickness 0.4 % of the width; the udcsc has 5
constexpr double least_pivot = 1e-11;
constexpr double least_tz = 1e-8;  // relative to the norm of the projection's third row

/// Centroid and scale for zero mean and unit rms coordinate (Hartley 1997).
template <int N>
struct Normalisation {
  Eigen::Matrix<double, N, 1> centre = Eigen::Matrix<double, N, 1>::Zero();
  double scale = 0;

  Eigen::Matrix<double, N + 1, 1> operator()(const Eigen::Matrix<double, N, 1>& p) const {
    return ((p - centre) / scale).eval().homogeneous();
  }
  Eigen::Matrix<double, N + 1, N + 1> matrix() const {
    Eigen::Matrix<double, N + 1, N + 1> m = Eigen::Matrix<double, N + 1, N + 1>::Identity();
    m.template topLeftCorner<N, N>() /= scale;
    m.template topRightCorner<N, 1>() = -centre / scale;
    return m;
  }
};

template <int N, class Member>
Normalisation<N> normalisation_of(std::span<const PointPair> points, Member member) {
  Normalisation<N> n;
  for (const PointPair& p : points) n.centre += p.*member / double(points.size());
  for (const PointPair& p : points) n.scale += (p.*member - n.centre).squaredNorm();
  n.scale = std::sqrt(n.scale / double(N * points.size()));
  return n;
}

struct NormalisedSystem {
  Normalisation<3> world;
  Normalisation<2> pixels;
  RightSingular singular;  ///< of the homogeneous design matrix
  double condition;
};

/// The twelfth singular value is the residual, so the eleventh decides whether the view is determined.
NormalisedSystem normalised_system(std::span<const PointPair> points) {
  NormalisedSystem system{normalisation_of<3>(points, &PointPair::point_in_world),
                          normalisation_of<2>(points, &PointPair::pixel),
                          {},
                          std::numeric_limits<double>::infinity()};
  if (!(system.world.scale > 0 && system.pixels.scale > 0)) return system;
  Eigen::MatrixXd design = Eigen::MatrixXd::Zero(2 * Eigen::Index(points.size()), 12);
  for (Eigen::Index i = 0; i < Eigen::Index(points.size()); ++i) {
    const PointPair& p = points[std::size_t(i)];
    const Eigen::RowVector4d x = system.world(p.point_in_world).transpose();
    const Eigen::Vector3d u = system.pixels(p.pixel);
    design.row(2 * i) << x, Eigen::RowVector4d::Zero(), -u.x() * x;
    design.row(2 * i + 1) << Eigen::RowVector4d::Zero(), x, -u.y() * x;
  }
  system.singular = right_singular(design);
  const Eigen::VectorXd& values = system.singular.values;
  if (values(10) > 0) system.condition = values(0) / values(10);
  return system;
}

Expected<NormalisedSystem> checked_system(std::span<const PointPair> points) {
  for (const PointPair& p : points)
    if (!p.point_in_world.allFinite() || !p.pixel.allFinite())
      return fail(Reason::not_finite, "a coordinate of a point is not finite");
  if (points.size() < 6)
    return fail(Reason::too_few_fiducials, fmt::format("{} points, at least 6 are needed", points.size()),
                {{"n", double(points.size())}});
  NormalisedSystem system = normalised_system(points);
  if (!(system.condition < largest_condition))
    return fail(Reason::coplanar_fiducials,
                fmt::format("the points are close to a plane, a line or another critical set that does not "
                            "constrain the view (condition {:.3g}, limit {:g})",
                            system.condition, largest_condition),
                {{"condition", system.condition}, {"n", double(points.size())}});
  return system;
}

struct ScaledSolution {
  DltFactors factors;
  double last_pivot;  ///< over the largest
};

/// Eq. 7 with centred pixels and columns of unit length: same residuals and minimiser, better conditioned
/// than E'E.
ScaledSolution solve_scaled(std::span<const PointPair> points) {
  const auto n = Eigen::Index(points.size());
  const Eigen::Vector2d centre = normalisation_of<2>(points, &PointPair::pixel).centre;
  Eigen::MatrixXd e = Eigen::MatrixXd::Zero(2 * n, 11);
  Eigen::VectorXd c(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto& [x, pixel] = points[std::size_t(i)];
    const Eigen::Vector2d u = pixel - centre;
    e.row(i) << x.transpose(), 1, -u.x() * x.transpose(), Eigen::RowVector4d::Zero();
    e.row(n + i) << Eigen::RowVector4d::Zero(), -u.y() * x.transpose(), x.transpose(), 1;
    c(i) = u.x();
    c(n + i) = u.y();
  }
  const DltFactors scale = e.colwise().norm().cwiseMax(std::numeric_limits<double>::min()).cwiseInverse();
  const LinearLeastSquares fit = linear_least_squares(e * scale.asDiagonal(), c);
  DltFactors a = scale.cwiseProduct(fit.solution);
  a.segment<3>(0) += centre.x() * a.segment<3>(4);
  a.segment<3>(7) += centre.y() * a.segment<3>(4);
  a(3) += centre.x();
  a(10) += centre.y();
  return {a, fit.last_pivot};
}

Expected<DltResult> result_of(const Projection& projection, const NormalisedSystem& system,
                              std::span<const PointPair> points) {
  auto view = decompose(projection, system.world.centre);
  if (!view) return tl::unexpected<Failure>(view.error());
  for (const PointPair& p : points)
    if (!(view->depth(p.point_in_world) > 0))
      return fail(Reason::behind_source, "no X-ray source position has all points in front of it",
                  {{"depth_mm", view->depth(p.point_in_world)}});
  return DltResult{*view, factors_from_projection(projection), system.condition};
}

}  // namespace

Projection projection_from_factors(const DltFactors& a) {
  Projection p;
  p << a.segment<4>(0).transpose(), a.segment<4>(7).transpose(), a.segment<3>(4).transpose(), 1;
  return p;
}

std::optional<DltFactors> factors_from_projection(const Projection& projection) {
  if (std::abs(projection(2, 3)) <= least_tz * projection.row(2).norm()) return std::nullopt;
  const Projection p = projection / projection(2, 3);
  DltFactors a;
  a << p.row(0).transpose(), p.row(2).head<3>().transpose(), p.row(1).transpose();
  return a;
}

Expected<double> dlt_condition(std::span<const PointPair> points) {
  return checked_system(points).map([](const NormalisedSystem& system) { return system.condition; });
}

DltFactors solve_dlt(std::span<const PointPair> points) { return solve_scaled(points).factors; }

Expected<DltResult> dlt_least_squares(std::span<const PointPair> points) {
  const auto system = checked_system(points);
  if (!system) return tl::unexpected<Failure>(system.error());
  const ScaledSolution scaled = solve_scaled(points);
  if (!(scaled.last_pivot > least_pivot))
    return fail(Reason::point_at_infinity,
                "Eq. 7 is singular: the world's origin lies in the plane of the X-ray source (t_z = 0); "
                "use the homogeneous form",
                {{"pivot", scaled.last_pivot}, {"condition", system->condition}});
  return result_of(projection_from_factors(scaled.factors), *system, points);
}

Expected<DltResult> dlt_homogeneous(std::span<const PointPair> points) {
  const auto system = checked_system(points);
  if (!system) return tl::unexpected<Failure>(system.error());
  const Eigen::Matrix<double, 12, 1> p = system->singular.vectors.col(11);
  Projection normalised;
  normalised << p.segment<4>(0).transpose(), p.segment<4>(4).transpose(), p.segment<4>(8).transpose();
  return result_of(system->pixels.matrix().inverse() * normalised * system->world.matrix(), *system, points);
}

double reprojection_rms(const View& view, std::span<const PointPair> points) {
  double sum = 0;
  for (const PointPair& p : points) sum += (view.project(p.point_in_world) - p.pixel).squaredNorm();
  return std::sqrt(sum / double(points.size()));
}

}  // namespace helicarm::geometry
