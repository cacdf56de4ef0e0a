// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/refine.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>

namespace helicarm {
namespace {

constexpr int most_iterations = 1000;
constexpr double least_gain = 1e-10;  // of chi2, before one last full step
constexpr double least_damping = 1e-12;
constexpr double most_damping = 1e12;

Eigen::Index ball_count(const std::vector<ViewProblem>& problems) {
  std::size_t count = 0;
  for (const ViewProblem& problem : problems)
    for (const Observation& seen : problem.observations) count = std::max(count, seen.ball + 1);
  return Eigen::Index(count);
}

bool is_tolerant(const std::vector<ViewProblem>& problems) {
  return std::ranges::any_of(problems, [](const ViewProblem& problem) {
    return std::ranges::any_of(problem.observations,
                               [](const Observation& seen) { return !seen.place_root.isZero(0); });
  });
}

Eigen::Index map_modes(const ViewProblem& problem) {
  return problem.observations.empty() ? 0 : problem.observations.front().by_map.size();
}

/// Rows at given views and departures; false where a point is not before its source. Without priors rho may
/// pass through zero on the way: nothing happens there.
bool evaluate(const std::vector<ViewProblem>& problems, const CommonPrior& common, Refinement& at) {
  std::vector<IntrinsicsPrior> normal_priors;
  Eigen::Index count = 0;
  for (const ViewProblem& problem : problems) {
    normal_priors.push_back(problem.prior);
    count += 2 * Eigen::Index(problem.observations.size());
  }
  const PriorRows priors = prior_rows(at.views, normal_priors, common.c_arm);
  const bool has_source =
      std::all_of(at.views.begin(), at.views.end(), [](const auto& v) { return v.rho > 0; });
  const bool needs_source = common.c_arm.focal || common.c_arm.principal ||
                            std::any_of(normal_priors.begin(), normal_priors.end(),
                                        [](const auto& normal_prior) { return normal_prior.aspect; });
  if (needs_source && !has_source) return false;
  const Eigen::Index steps = view_parameters * Eigen::Index(problems.size());
  const Eigen::Index own = at.variations.size();
  at.residuals.resize(count + priors.residuals.size() + own);
  at.jacobian = Eigen::MatrixXd::Zero(at.residuals.size(), steps + own);
  const bool tolerant = is_tolerant(problems);
  Eigen::Index row = 0;
  Eigen::Index map = tolerant ? 3 * ball_count(problems) : 0;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const Eigen::Index modes = map_modes(problems[i]);
    for (const Observation& seen : problems[i].observations) {
      const Eigen::Index ball = 3 * Eigen::Index(seen.ball);
      Eigen::Vector3d place = seen.point_in_world;
      if (tolerant) place += seen.place_root * at.variations.segment<3>(ball);
      ImageCoordinates image = image_of(at.views[i], place);
      if (!(image.relative_depth > 0)) return false;
      for (Eigen::Index axis = 0; axis < (modes > 0 ? 2 : 0); ++axis) {
        const Eigen::Index first = map + axis * modes;
        image.pixel[axis] += seen.by_map.dot(at.variations.segment(first, modes));
        at.jacobian.block(row + axis, steps + first, 1, modes) = seen.by_map / seen.sigma_px;
      }
      at.residuals.segment<2>(row) = (image.pixel - seen.pixel) / seen.sigma_px;
      at.jacobian.block<2, view_parameters>(row, view_parameters * Eigen::Index(i)) =
          image.by_step / seen.sigma_px;
      if (tolerant)
        at.jacobian.block<2, 3>(row, steps + ball) = image.by_place * seen.place_root / seen.sigma_px;
      row += 2;
    }
    map += 2 * modes;
  }
  at.residuals.segment(count, priors.residuals.size()) = priors.residuals;
  at.jacobian.block(count, 0, priors.residuals.size(), steps) = priors.jacobian;
  at.residuals.tail(own) = at.variations;
  at.jacobian.bottomRightCorner(own, own).setIdentity();
  at.chi2 = at.residuals.squaredNorm();
  at.dof = int(at.jacobian.rows() - at.jacobian.cols());
  return std::isfinite(at.chi2);
}

void move(const Refinement& from, const Eigen::VectorXd& step, Refinement& to) {
  for (std::size_t i = 0; i < from.views.size(); ++i)
    to.views.push_back(
        moved(from.views[i], step.segment<view_parameters>(view_parameters * Eigen::Index(i))));
  to.variations = from.variations + step.tail(from.variations.size());
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

Expected<Refinement> refine(const std::vector<ViewProblem>& problems, const CommonPrior& common) {
  Refinement at;
  Eigen::Index own = is_tolerant(problems) ? 3 * ball_count(problems) : 0;
  for (const ViewProblem& problem : problems) {
    at.views.push_back(problem.start);
    own += 2 * map_modes(problem);
  }
  at.variations = Eigen::VectorXd::Zero(own);
  if (!evaluate(problems, common, at)) return open_views(at);
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
      move(at, done ? newton : Eigen::VectorXd(-damped.ldlt().solve(slope)), next);
      lower = evaluate(problems, common, next) && next.chi2 < at.chi2;
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
