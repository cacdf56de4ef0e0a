// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/refine.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>

namespace helicarm {
namespace {

constexpr int most_iterations = 200;
constexpr double least_gain = 1e-10;  // of chi2, before one last full step
constexpr double least_damping = 1e-12;
constexpr double most_damping = 1e12;

/// Rows at given views; false where a point is not before its source. Without priors rho may pass through
/// zero on the way: nothing happens there.
bool evaluate(const std::vector<ViewProblem>& problems, const SpreadPrior& spread, Refinement& at) {
  std::vector<IntrinsicsPrior> beliefs;
  Eigen::Index count = 0;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    beliefs.push_back(problems[i].prior);
    count += 2 * Eigen::Index(problems[i].observations.size());
  }
  const PriorRows priors = prior_rows(at.views, beliefs, spread);
  const bool has_source =
      std::all_of(at.views.begin(), at.views.end(), [](const auto& v) { return v.rho > 0; });
  if (priors.residuals.size() > 0 && !has_source) return false;
  const Eigen::Index columns = 10 * Eigen::Index(problems.size());
  at.residuals.resize(count + priors.residuals.size());
  at.jacobian = Eigen::MatrixXd::Zero(at.residuals.size(), columns);
  Eigen::Index row = 0;
  for (std::size_t i = 0; i < problems.size(); ++i)
    for (const Observation& seen : problems[i].observations) {
      const Picture picture = picture_of(at.views[i], seen.point_in_world);
      if (!(picture.relative_depth > 0)) return false;
      at.residuals.segment<2>(row) = (picture.pixel - seen.pixel) / seen.sigma_px;
      at.jacobian.block<2, 10>(row, 10 * Eigen::Index(i)) = picture.by_step / seen.sigma_px;
      row += 2;
    }
  at.residuals.tail(priors.residuals.size()) = priors.residuals;
  at.jacobian.bottomRows(priors.residuals.size()) = priors.jacobian;
  at.chi2 = at.residuals.squaredNorm();
  at.dof = int(count) + priors.independent - int(columns);
  return std::isfinite(at.chi2);
}

std::vector<CentredView> all_moved(const std::vector<CentredView>& views, const Eigen::VectorXd& step) {
  std::vector<CentredView> next;
  for (std::size_t i = 0; i < views.size(); ++i)
    next.push_back(moved(views[i], step.segment<10>(10 * Eigen::Index(i))));
  return next;
}

tl::unexpected<Failure> open_views(const Refinement& at) {
  return fail(Reason::uncertain, "the balls' pictures do not fix the views", {{"chi2", at.chi2}});
}

/// Nothing where the columns, scaled to unit length, are dependent.
std::optional<Eigen::MatrixXd> covariance_of(const Eigen::MatrixXd& jacobian) {
  const Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
  const Eigen::VectorXd root = normal.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::LDLT<Eigen::MatrixXd> scaled(root.asDiagonal() * normal * root.asDiagonal());
  if (scaled.info() != Eigen::Success || !(scaled.rcond() > 1e-15)) return std::nullopt;
  const Eigen::MatrixXd inverse = scaled.solve(Eigen::MatrixXd::Identity(normal.rows(), normal.cols()));
  return root.asDiagonal() * (inverse + inverse.transpose()) / 2 * root.asDiagonal();
}

}  // namespace

Expected<Refinement> refine(const std::vector<ViewProblem>& problems, const SpreadPrior& spread) {
  Refinement at;
  for (const ViewProblem& problem : problems) at.views.push_back(problem.start);
  if (!evaluate(problems, spread, at)) return open_views(at);
  double damping = 1e-3;
  bool done = false;
  for (int i = 0; i < most_iterations && !done; ++i) {
    const Eigen::MatrixXd normal = at.jacobian.transpose() * at.jacobian;
    const Eigen::VectorXd slope = at.jacobian.transpose() * at.residuals;
    const Eigen::VectorXd newton = -normal.ldlt().solve(slope);
    done = newton.allFinite() && -slope.dot(newton) <= least_gain * (1 + at.chi2);
    for (bool lower = false; !lower && damping < most_damping;) {
      Eigen::MatrixXd damped = normal;
      damped.diagonal() *= 1 + damping;
      Refinement next;
      next.views = all_moved(at.views, done ? newton : Eigen::VectorXd(-damped.ldlt().solve(slope)));
      lower = evaluate(problems, spread, next) && next.chi2 < at.chi2;
      if (lower) at = std::move(next);
      if (done) break;
      damping = lower ? std::max(least_damping, damping / 8) : damping * 5;
    }
  }
  const auto covariance = done ? covariance_of(at.jacobian) : std::nullopt;
  if (!covariance) return open_views(at);
  at.covariance = *covariance;
  return at;
}

}  // namespace helicarm
