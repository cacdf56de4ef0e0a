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
Eigen::Index offset_count(const std::vector<ViewProblem>& problems) {
  Eigen::Index count = 0;
  for (const ViewProblem& problem : problems)
    for (const Observation& observation : problem.observations)
      count = std::max(count, observation.first_offset + observation.offset_root.cols());
  return count;
}

/// Rows at given views and offsets; false if a point is not in front of its source. Without priors on the
/// intrinsics rho may pass through zero during the iteration.
bool evaluate(const std::vector<ViewProblem>& problems, const CommonPrior& common, Refinement& at) {
  std::vector<geometry::IntrinsicsPrior> normal_priors;
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
  Eigen::Index row = 0;
  Eigen::Index map = offset_count(problems);
  for (std::size_t i = 0; i < problems.size(); ++i) {
    const Eigen::Index modes = map_modes(problems[i]);
    for (const Observation& observation : problems[i].observations) {
      const Eigen::Index first_offset = observation.first_offset, offsets = observation.offset_root.cols();
      const Eigen::Vector3d position =
          observation.point_in_world + observation.offset_root * at.variations.segment(first_offset, offsets);
      ImageCoordinates image = image_of(at.views[i], position);
      if (!(image.relative_depth > 0)) return false;
      for (Eigen::Index axis = 0; axis < (modes > 0 ? 2 : 0); ++axis) {
        const Eigen::Index first = map + axis * modes;
        image.pixel[axis] += observation.by_map.dot(at.variations.segment(first, modes));
        at.jacobian.block(row + axis, steps + first, 1, modes) = observation.by_map / observation.sigma_px;
      }
      at.residuals.segment<2>(row) = (image.pixel - observation.pixel) / observation.sigma_px;
      at.jacobian.block<2, view_parameters>(row, view_parameters * Eigen::Index(i)) =
          image.by_step / observation.sigma_px;
      at.jacobian.block(row, steps + first_offset, 2, offsets) =
          image.by_point * observation.offset_root / observation.sigma_px;
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

Refinement moved_by(const Refinement& from, const Eigen::VectorXd& step) {
  Refinement to;
  for (std::size_t i = 0; i < from.views.size(); ++i)
    to.views.push_back(
        moved(from.views[i], step.segment<view_parameters>(view_parameters * Eigen::Index(i))));
  to.variations = from.variations + step.tail(from.variations.size());
  return to;
}

tl::unexpected<Failure> unconstrained(const Refinement& at, const std::string& why) {
  return fail(Reason::uncertain, "the fiducials do not constrain the views' parameters: " + why,
              {{"chi2", at.chi2}});
}

/// `uncertain` if the columns, scaled to unit length, are dependent.
Expected<Eigen::MatrixXd> covariance_of(const Refinement& at) {
  constexpr double least_rcond = 1e-15;
  const Eigen::MatrixXd& jacobian = at.jacobian;
  const Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
  const Eigen::VectorXd root = normal.diagonal().cwiseSqrt().cwiseInverse();
  const auto [inverse, rcond] = geometry::solve_spd(root.asDiagonal() * normal * root.asDiagonal(),
                                                    Eigen::MatrixXd::Identity(normal.rows(), normal.cols()));
  if (!(rcond > least_rcond))
    return unconstrained(
        at, fmt::format("reciprocal condition number {:.1g} of the normal equations, limit {:g}", rcond,
                        least_rcond));
  return Eigen::MatrixXd(root.asDiagonal() * (inverse + inverse.transpose()) / 2 * root.asDiagonal());
}

}  // namespace

Eigen::Index map_modes(const ViewProblem& problem) {
  return problem.observations.empty() ? 0 : problem.observations.front().by_map.size();
}

Expected<Refinement> refine(const std::vector<ViewProblem>& problems, const CommonPrior& common) {
  Refinement at;
  Eigen::Index own = offset_count(problems);
  for (const ViewProblem& problem : problems) {
    at.views.push_back(problem.start);
    own += 2 * map_modes(problem);
  }
  at.variations = Eigen::VectorXd::Zero(own);
  const auto linearise = [&](Refinement& state) -> std::optional<geometry::NormalEquations<Eigen::Dynamic>> {
    if (!evaluate(problems, common, state)) return std::nullopt;
    return geometry::NormalEquations<Eigen::Dynamic>{state.jacobian.transpose() * state.jacobian,
                                                     -state.jacobian.transpose() * state.residuals,
                                                     state.chi2};
  };
  auto fit = geometry::fit_least_squares<Eigen::Dynamic>(at, linearise, moved_by, iteration);
  if (!fit)
    return unconstrained(
        at, "in the starting views a fiducial lies behind the source, or a source distance is negative");
  at = std::move(fit->state);
  if (!fit->converged)
    return unconstrained(at, fmt::format("no convergence in {} iterations", iteration.max_iterations));
  return covariance_of(at).map([&](const Eigen::MatrixXd& covariance) {
    at.covariance = covariance;
    return at;
  });
}

}  // namespace helicarm::calibration
