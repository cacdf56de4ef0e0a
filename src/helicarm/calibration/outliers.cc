// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/outliers.h"

#include <cmath>
#include <optional>

#include <Eigen/Eigenvalues>

namespace helicarm {
namespace {

/// The balls' sigmas are believed as if they came from so many degrees of freedom.
constexpr double belief_in_sigma = 8;
constexpr double least_freedom = 1e-6;  // a residual that its own ball pulls to zero tells nothing

/// How much chi2 would fall without each observation; the worst of those that may go.
struct Worst {
  ObservationIndex index;
  double fall = 0;
};

std::optional<Worst> worst_of(const std::vector<ViewProblem>& problems, const Refinement& fit,
                              std::size_t least_kept) {
  std::optional<Worst> worst;
  Eigen::Index row = 0;
  for (std::size_t v = 0; v < problems.size(); ++v)
    for (std::size_t i = 0; i < problems[v].observations.size(); ++i, row += 2) {
      if (problems[v].observations.size() <= least_kept) continue;
      const auto j = fit.jacobian.middleRows<2>(row);
      const Eigen::Matrix2d freedom = Eigen::Matrix2d::Identity() - j * fit.covariance * j.transpose();
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(freedom);
      const Eigen::Vector2d r = eigen.eigenvectors().transpose() * fit.residuals.segment<2>(row);
      double fall = 0;
      for (Eigen::Index k = 0; k < 2; ++k)
        if (eigen.eigenvalues()(k) > least_freedom) fall += r(k) * r(k) / eigen.eigenvalues()(k);
      if (!worst || fall > worst->fall) worst = Worst{{v, i}, fall};
    }
  return worst;
}

/// Probability of so large a fall of chi2 by chance: the tail of an F(2, dof) distribution.
double chance_of(double fall, const Refinement& after) {
  const double dof = belief_in_sigma + after.dof;
  const double variance = std::max(1.0, (belief_in_sigma + after.chi2) / dof);
  return std::pow(1 + fall / variance / dof, -dof / 2);
}

}  // namespace

Expected<CleanFit> refine_without_outliers(std::vector<ViewProblem> problems, const SpreadPrior& spread,
                                           double probability, std::size_t least_kept) {
  auto fit = refine(problems, spread);
  if (!fit) return tl::unexpected<Failure>(fit.error());
  CleanFit clean{problems, *fit, {}};
  if (probability <= 0) return clean;

  std::vector<std::vector<std::size_t>> places;
  std::size_t count = 0;
  for (const ViewProblem& problem : problems) {
    places.emplace_back(problem.observations.size());
    for (std::size_t i = 0; i < places.back().size(); ++i) places.back()[i] = i;
    count += places.back().size();
  }
  CleanFit peeled = clean;
  for (std::size_t round = 0; round < count / 3; ++round) {
    const auto worst = worst_of(peeled.problems, peeled.fit, least_kept);
    if (!worst) break;
    const auto [v, i] = worst->index;
    ViewProblem& problem = peeled.problems[v];
    problem.observations.erase(problem.observations.begin() + std::ptrdiff_t(i));
    peeled.removed.push_back({v, places[v][i]});
    places[v].erase(places[v].begin() + std::ptrdiff_t(i));
    for (std::size_t k = 0; k < problems.size(); ++k) peeled.problems[k].start = peeled.fit.views[k];
    auto after = refine(peeled.problems, spread);
    if (!after) break;
    const double fall = peeled.fit.chi2 - after->chi2;
    peeled.fit = *std::move(after);
    if (chance_of(fall, peeled.fit) < probability) clean = peeled;
  }
  return clean;
}

}  // namespace helicarm
