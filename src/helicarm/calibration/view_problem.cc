// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/view_problem.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::calibration {
namespace {

/// The given start, or the homogeneous DLT.
Expected<CentredView> start_of(const ViewFiducials& view, const std::vector<geometry::PointPair>& pairs,
                               const Eigen::Vector3d& centre) {
  if (view.start)
    return geometry::dlt_condition(pairs).map([&](double) { return centred(*view.start, centre); });
  return geometry::dlt_homogeneous(pairs).map(
      [&](const geometry::DltResult& dlt) { return shrunk_to_prior(centred(dlt.view, centre), view.prior); });
}

/// Splits each sigma into the fiducial's own and the map's, which is correlated: independent errors along the
/// eigenvectors of its covariance.
void split_map_errors(std::vector<Observation>& observations, const Eigen::MatrixXd& covariance_px2) {
  constexpr double least_own_share = 0.1;  // of the variance
  if (covariance_px2.size() == 0 || covariance_px2.isZero()) return;
  const auto [values, vectors] = geometry::symmetric_eigen(covariance_px2);
  const Eigen::MatrixXd modes = vectors * values.cwiseMax(0).cwiseSqrt().asDiagonal();
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const auto k = Eigen::Index(i);
    const double variance = observations[i].sigma_px * observations[i].sigma_px;
    observations[i].sigma_px =
        std::sqrt(std::max(variance - covariance_px2(k, k), least_own_share * variance));
    observations[i].by_map = modes.row(k);
  }
}

/// Square root of a covariance, without the directions that have no variance.
Eigen::MatrixXd root_of(const Eigen::MatrixXd& covariance) {
  constexpr double least_share = 1e-12;
  const auto [values, vectors] = geometry::symmetric_eigen(covariance);
  const auto n = covariance.rows();
  const Eigen::Index none = (values.array() <= least_share * values[n - 1]).count();
  return vectors.rightCols(n - none) * values.tail(n - none).cwiseSqrt().asDiagonal();
}

}  // namespace

std::vector<geometry::PointPair> pairs_of(const std::vector<fiducials::Fiducial>& fiducials) {
  std::vector<geometry::PointPair> pairs;
  for (const fiducials::Fiducial& f : fiducials)
    if (f.status == fiducials::FiducialStatus::used) pairs.push_back({f.centre_in_calibrator, f.uv});
  return pairs;
}

Eigen::MatrixXd OffsetRoots::directions() const {
  const auto balls = Eigen::Index(of_ball.size());
  const Eigen::Index errors = joint ? (balls > 0 ? of_ball.front().cols() : 0) : 3 * balls;
  Eigen::MatrixXd roots = Eigen::MatrixXd::Zero(3 * balls, errors);
  for (std::size_t ball = 0; ball < of_ball.size(); ++ball)
    roots.block(3 * Eigen::Index(ball), first(ball), 3, of_ball[ball].cols()) = of_ball[ball];
  for (Eigen::Index column = 0; column < errors; ++column) roots.col(column).normalize();
  return roots;
}

OffsetRoots offset_roots(const CommonPrior& common) {
  OffsetRoots roots;
  roots.joint = common.joint_ball_covariance_mm2.size() > 0;
  for (const Eigen::Matrix3d& covariance : common.ball_covariance_mm2)
    if (!roots.joint) roots.of_ball.emplace_back(root_of(covariance));
  if (!roots.joint) return roots;
  const Eigen::MatrixXd root = root_of(common.joint_ball_covariance_mm2);
  for (Eigen::Index row = 0; row < root.rows(); row += 3) roots.of_ball.emplace_back(root.middleRows(row, 3));
  return roots;
}

Expected<ViewProblem> problem_of(const ViewFiducials& view, const OffsetRoots& roots) {
  std::vector<Observation> observations;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (std::size_t ball = 0; ball < view.fiducials.size(); ++ball) {
    const fiducials::Fiducial& f = view.fiducials[ball];
    if (f.status != fiducials::FiducialStatus::used) continue;
    if (!(f.sigma_px > 0) || !std::isfinite(f.sigma_px))
      return fail(Reason::bad_value,
                  fmt::format("fiducial {}: sigma_px is {}, must be positive", f.label, f.sigma_px));
    observations.push_back({ball, f.centre_in_calibrator, f.uv, f.sigma_px});
    if (!roots.of_ball.empty()) {
      observations.back().offset_root = roots.of_ball[ball];
      observations.back().first_offset = roots.first(ball);
    }
    centre += f.centre_in_calibrator;
  }
  centre /= std::max(1.0, double(observations.size()));
  split_map_errors(observations, view.map_covariance_px2);
  const auto start = start_of(view, pairs_of(view.fiducials), centre);
  if (!start) return tl::unexpected<Failure>(start.error());
  return ViewProblem{*start, std::move(observations), view.prior};
}

}  // namespace helicarm::calibration
