// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/distortion_check.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/calibration/ball_offsets.h"
#include "helicarm/calibration/view_problem.h"
#include "helicarm/core/statistics.h"
#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::calibration {
namespace {

constexpr Eigen::Index modes_of_view = 8;
using Modes = Eigen::Matrix<double, 2, modes_of_view>;

/// Displacements of an image point. Affine ones are the camera's.
Modes modes_at(const Eigen::Vector2d& p) {
  const double x = p.x(), y = p.y(), r2 = p.squaredNorm();
  Modes modes;
  modes << x * x, x * y, y * y, 0, 0, 0, r2 * x, -r2 * y,  //
      0, 0, 0, x * x, x * y, y * y, r2 * y, r2 * x;
  return modes;
}

/// Mean and rms distance of a view's image points: the modes' origin and unit.
struct Extent {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  double radius = 0;
};

Extent extent_of(const ViewProblem& problem) {
  Extent extent;
  const double n = double(problem.observations.size());
  for (const Observation& observation : problem.observations) extent.middle += observation.pixel / n;
  for (const Observation& observation : problem.observations)
    extent.radius += (observation.pixel - extent.middle).squaredNorm() / n;
  extent.radius = std::sqrt(extent.radius);
  return extent;
}

/// The view's modes as columns of all views'.
Eigen::MatrixXd distortion_columns(const std::vector<ViewProblem>& problems, std::size_t view) {
  const std::vector<Observation>& observations = problems[view].observations;
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(2 * Eigen::Index(observations.size()),
                                                  modes_of_view * Eigen::Index(problems.size()));
  const Extent extent = extent_of(problems[view]);
  Eigen::Index row = 0;
  for (const Observation& observation : observations) {
    columns.block<2, modes_of_view>(row, modes_of_view * Eigen::Index(view)) =
        modes_at((observation.pixel - extent.middle) / extent.radius) / observation.sigma_px;
    row += 2;
  }
  return columns;
}

/// Decrease of chi2 by the columns, to first order; `prior_sigma_px` of each amount.
double chi2_gain(const Refinement& fit, const std::vector<Eigen::MatrixXd>& columns, double prior_sigma_px) {
  Eigen::MatrixXd information = information_beyond(fit, columns);
  information.diagonal().array() += 1 / (prior_sigma_px * prior_sigma_px);
  const Eigen::VectorXd slope = slope_along(fit, columns);
  return slope.dot(geometry::solve_spd(information, slope).solution.col(0));
}

}  // namespace

std::optional<Warning> check_distortion(const std::vector<ViewFiducials>& views, const CommonPrior& common) {
  constexpr double excess_sigmas = 3;    // of chi2
  constexpr double least_ratio = 8;      // F statistic: 1e-4 with 8 and 12 degrees of freedom
  constexpr double prior_sigma_px = 20;  // of intensifiers
  constexpr int least_dof = 6;           // with the distortion
  const OffsetRoots roots = offset_roots(common);
  std::vector<ViewProblem> problems;
  for (const ViewFiducials& view : views) {
    auto problem = problem_of(view, roots);
    if (!problem) return std::nullopt;
    problems.push_back(*std::move(problem));
  }
  const auto fit = refine(problems, common);
  if (!fit || fit->dof < 1 || chi2_excess(fit->chi2, fit->dof) < excess_sigmas) return std::nullopt;
  const auto modes = double(modes_of_view) * double(views.size());
  const double dof = fit->dof - modes;
  if (dof < least_dof) return std::nullopt;
  std::vector<Eigen::MatrixXd> columns;
  for (std::size_t i = 0; i < problems.size(); ++i) columns.push_back(distortion_columns(problems, i));
  const double gain = chi2_gain(*fit, columns, prior_sigma_px);
  const double left = fit->chi2 - gain;
  if (gain / modes < least_ratio * std::max(1.0, left / dof)) return std::nullopt;
  return Warning{
      Reason::residual_distortion,
      fmt::format(
          "smooth distortions of the images explain the fiducials' residuals (chi2 {:.0f} without, "
          "{:.0f} with them): a distortion map is of another C-arm position (plate images exchanged), "
          "or missing. The intrinsics absorb a part and may be several per cent off; points among the "
          "fiducials are less affected. Name each view's own plate image or map",
          fit->chi2, left),
      {},
      {{"chi2_before", fit->chi2}, {"chi2_after", left}, {"dof", dof}}};
}

}  // namespace helicarm::calibration
