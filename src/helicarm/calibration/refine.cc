// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/refine.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <fmt/format.h>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/least_squares.h"

namespace helicarm::calibration {
namespace {

constexpr geometry::LeastSquaresOptions iteration{.max_iterations = 1000, .min_gain = 1e-10};

/// Number of the fiducials' unit errors; 0: as in the file.
Eigen::Index offset_count(const std::vector<ViewProblem>& problems, const CommonPrior& common) {
  Eigen::Index count = common.c_arm.by_ball_errors.cols();
  for (const ViewProblem& problem : problems)
    for (const Observation& observation : problem.observations)
      count = std::max(count, observation.first_offset + observation.offset_root.cols());
  return count;
}

/// The rows of a view at given unknowns; false if a point is not in front of its source.
bool evaluate_view(const ViewProblem& problem, const CommonPrior& common, const CentredView& view,
                   const Eigen::VectorXd& map_errors, const Eigen::VectorXd& units, ViewRows& rows) {
  const Eigen::Index of_prior = common.c_arm.by_ball_errors.cols();
  const PriorRows priors = prior_rows(view, problem.prior, common.c_arm,
                                      units.tail<CArmDeviation::SizeAtCompileTime>(), units.head(of_prior));
  const Eigen::Index modes = map_modes(problem);
  const auto count = 2 * Eigen::Index(problem.observations.size());
  const Eigen::Index all = count + priors.residuals.size();
  rows.residuals.resize(all);
  rows.by_own = Eigen::MatrixXd::Zero(all, view_parameters + 2 * modes);
  rows.by_common = Eigen::MatrixXd::Zero(all, units.size());
  Eigen::Index row = 0;
  for (const Observation& observation : problem.observations) {
    const Eigen::Index first_offset = observation.first_offset, offsets = observation.offset_root.cols();
    const Eigen::Vector3d position =
        observation.point_in_world + observation.offset_root * units.segment(first_offset, offsets);
    ImageCoordinates image = image_of(view, position);
    if (!(image.relative_depth > 0)) return false;
    for (Eigen::Index axis = 0; axis < (modes > 0 ? 2 : 0); ++axis) {
      image.pixel[axis] += observation.by_map.dot(map_errors.segment(axis * modes, modes));
      rows.by_own.block(row + axis, view_parameters + axis * modes, 1, modes) =
          observation.by_map / observation.sigma_px;
    }
    rows.residuals.segment<2>(row) = (image.pixel - observation.pixel) / observation.sigma_px;
    rows.by_own.block<2, view_parameters>(row, 0) = image.by_step / observation.sigma_px;
    rows.by_common.block(row, first_offset, 2, offsets) =
        image.by_point * observation.offset_root / observation.sigma_px;
    row += 2;
  }
  rows.residuals.tail(all - count) = priors.residuals;
  rows.by_own.bottomLeftCorner(all - count, view_parameters) = priors.by_step;
  rows.by_common.bottomRightCorner(all - count, CArmDeviation::SizeAtCompileTime) = priors.by_c_arm;
  rows.by_common.bottomLeftCorner(all - count, of_prior) = priors.by_ball_errors;
  return true;
}

/// Without priors on the intrinsics rho may pass through zero during the iteration.
bool has_sources(const std::vector<ViewProblem>& problems, const CommonPrior& common, const Refinement& at) {
  const bool needs_source =
      common.c_arm.focal || common.c_arm.principal ||
      std::ranges::any_of(problems, [](const auto& problem) { return problem.prior.aspect.has_value(); });
  return !needs_source || std::ranges::all_of(at.views, [](const auto& view) { return view.rho > 0; });
}

/// Nothing where a point or the source is on the wrong side.
std::optional<geometry::ArrowEquations> linearised(const std::vector<ViewProblem>& problems,
                                                   const CommonPrior& common, Refinement& at) {
  if (!has_sources(problems, common, at)) return std::nullopt;
  const Eigen::Index units = at.common.size();
  geometry::ArrowEquations equations{
      {}, Eigen::MatrixXd::Identity(units, units), -at.common, at.common.squaredNorm()};
  at.rows.resize(problems.size());
  at.dof = 0;
  for (std::size_t i = 0; i < problems.size(); ++i) {
    ViewRows& rows = at.rows[i];
    if (!evaluate_view(problems[i], common, at.views[i], at.map_errors[i], at.common, rows))
      return std::nullopt;
    geometry::ArrowEquations::Block block{rows.by_own.transpose() * rows.by_own,
                                          rows.by_own.transpose() * rows.by_common,
                                          -rows.by_own.transpose() * rows.residuals};
    const Eigen::Index errors = at.map_errors[i].size();
    block.information.diagonal().tail(errors).array() += 1;
    block.gradient.tail(errors) -= at.map_errors[i];
    equations.blocks.push_back(std::move(block));
    equations.common += rows.by_common.transpose() * rows.by_common;
    equations.common_gradient -= rows.by_common.transpose() * rows.residuals;
    equations.chi2 += rows.residuals.squaredNorm() + at.map_errors[i].squaredNorm();
    at.dof += int(rows.residuals.size()) - view_parameters;
  }
  at.chi2 = equations.chi2;
  if (!std::isfinite(at.chi2)) return std::nullopt;
  return equations;
}

Refinement moved_by(const Refinement& from, const Eigen::VectorXd& step) {
  Refinement to;
  Eigen::Index at = 0;
  for (std::size_t i = 0; i < from.views.size(); ++i) {
    const Eigen::Index errors = from.map_errors[i].size();
    to.views.push_back(moved(from.views[i], step.segment<view_parameters>(at)));
    to.map_errors.emplace_back(from.map_errors[i] + step.segment(at + view_parameters, errors));
    at += view_parameters + errors;
  }
  to.common = from.common + step.tail(from.common.size());
  return to;
}

tl::unexpected<Failure> unconstrained(const Refinement& at, const std::string& why) {
  return fail(Reason::uncertain, "the fiducials do not constrain the views' parameters: " + why,
              {{"chi2", at.chi2}});
}

/// J^T M, M the columns on a view's observations.
struct Projection {
  Eigen::MatrixXd own, common;
};

Projection projection_of(const ViewRows& rows, const Eigen::MatrixXd& columns) {
  return {rows.by_own.topRows(columns.rows()).transpose() * columns,
          rows.by_common.topRows(columns.rows()).transpose() * columns};
}

}  // namespace

Eigen::Index map_modes(const ViewProblem& problem) {
  return problem.observations.empty() ? 0 : problem.observations.front().by_map.size();
}

Eigen::MatrixXd Refinement::covariance_of_steps() const {
  const auto count = Eigen::Index(views.size());
  Eigen::MatrixXd steps(view_parameters * count, view_parameters * count);
  std::vector<Eigen::MatrixXd> response;
  for (const Eigen::MatrixXd& one : covariance.response) response.emplace_back(one.topRows(view_parameters));
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::MatrixXd by_common = response[std::size_t(i)] * covariance.of_common;
    for (Eigen::Index j = 0; j < count; ++j)
      steps.block<view_parameters, view_parameters>(view_parameters * i, view_parameters * j) =
          by_common * response[std::size_t(j)].transpose();
    steps.block<view_parameters, view_parameters>(view_parameters * i, view_parameters * i) +=
        covariance.own[std::size_t(i)].topLeftCorner(view_parameters, view_parameters);
  }
  return (steps + steps.transpose()) / 2;
}

Eigen::MatrixXd Refinement::steps_by_offsets(std::size_t view) const {
  return covariance.response[view].topRows(view_parameters) * covariance.of_common.leftCols(offsets());
}

Eigen::MatrixXd Refinement::by_common_alone(std::size_t view, const Eigen::MatrixXd& by_own,
                                            const Eigen::MatrixXd& by_common) const {
  return by_common - by_own * covariance.response[view];
}

Eigen::MatrixXd information_beyond(const Refinement& fit, const std::vector<Eigen::MatrixXd>& columns) {
  const Eigen::Index effects = columns.front().cols();
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(effects, effects);
  Eigen::MatrixXd common = Eigen::MatrixXd::Zero(fit.common.size(), effects);
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const Projection on = projection_of(fit.rows[i], columns[i]);
    information += columns[i].transpose() * columns[i];
    information -= on.own.transpose() * fit.covariance.own[i] * on.own;
    common += on.common - fit.covariance.response[i].transpose() * on.own;
  }
  return information - common.transpose() * fit.covariance.of_common * common;
}

Eigen::VectorXd slope_along(const Refinement& fit, const std::vector<Eigen::MatrixXd>& columns) {
  Eigen::VectorXd slope = Eigen::VectorXd::Zero(columns.front().cols());
  for (std::size_t i = 0; i < columns.size(); ++i)
    slope += columns[i].transpose() * fit.rows[i].residuals.head(columns[i].rows());
  return slope;
}

Expected<Refinement> refine(const std::vector<ViewProblem>& problems, const CommonPrior& common) {
  constexpr double least_rcond = 1e-15;
  Refinement at;
  for (const ViewProblem& problem : problems) {
    at.views.push_back(problem.start);
    at.map_errors.emplace_back(Eigen::VectorXd::Zero(2 * map_modes(problem)));
  }
  at.common = Eigen::VectorXd::Zero(offset_count(problems, common) + CArmDeviation::SizeAtCompileTime);
  const auto linearise = [&](Refinement& state) { return linearised(problems, common, state); };
  auto fit = geometry::fit_least_squares(at, linearise, moved_by, iteration);
  if (!fit)
    return unconstrained(
        at, "in the starting views a fiducial lies behind the source, or a source distance is negative");
  at = std::move(fit->state);
  if (!fit->converged)
    return unconstrained(at, fmt::format("no convergence in {} iterations", iteration.max_iterations));
  at.covariance = geometry::inverse(fit->equations);
  if (const double rcond = at.covariance.rcond; !(rcond > least_rcond))
    return unconstrained(
        at, fmt::format("reciprocal condition number {:.1g} of the normal equations, limit {:g}", rcond,
                        least_rcond));
  return at;
}

}  // namespace helicarm::calibration
