// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/outliers.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <optional>

#include <Eigen/LU>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::calibration {
namespace {

/// Degrees of freedom of the prior on the scale of the sigmas.
constexpr double prior_dof = 8;
constexpr double least_freedom = 1e-6;  // below it the residual is determined by its own observation

/// Decrease of chi2 on removal of an observation. `freedom`: covariance of its residual for unit noise.
double decrease_without(const Eigen::Vector2d& residual, const Eigen::Matrix2d& freedom) {
  const auto [values, vectors] = geometry::symmetric_eigen(freedom);
  const Eigen::Vector2d r = vectors.transpose() * residual;
  double decrease = 0;
  for (Eigen::Index k = 0; k < 2; ++k)
    if (values[k] > least_freedom) decrease += r[k] * r[k] / values[k];
  return decrease;
}

/// p-value of the decrease of chi2: tail of an F(2, dof) distribution.
double p_value(double decrease, double chi2_after, int dof_after) {
  const double dof = prior_dof + dof_after;
  const double variance = std::max(1.0, (prior_dof + chi2_after) / dof);
  return std::pow(1 + decrease / variance / dof, -dof / 2);
}

/// Removes observations one by one from a fit, to first order: with U = J P J_k^T of the present covariance P
/// and F_k = 1 - J_k P J_k^T, a removal of k lowers chi2 by r_k^T F_k^-1 r_k, adds U F_k^-1 r_k to the
/// residuals r and takes U F_k^-1 U^T from F.
class Removals {
 public:
  Removals(const std::vector<ViewProblem>& problems, const Refinement& fit, std::size_t least_kept)
      : fit_(fit), least_kept_(least_kept) {
    for (std::size_t v = 0; v < problems.size(); ++v) {
      first_.push_back(index_.size());
      kept_.push_back(problems[v].observations.size());
      for (std::size_t i = 0; i < kept_.back(); ++i) index_.push_back({v, i});
    }
    const auto rows = 2 * Eigen::Index(index_.size());
    alone_.resize(rows, fit.common.size());
    residuals_.resize(rows);
    freedom_.resize(rows, 2);
    effects_.resize(rows, 0);
    for (std::size_t v = 0; v < problems.size(); ++v) {
      const auto observed = 2 * Eigen::Index(kept_[v]), at = 2 * Eigen::Index(first_[v]);
      const Eigen::MatrixXd by_own = fit.rows[v].by_own.topRows(observed);
      alone_.middleRows(at, observed) =
          fit.by_common_alone(v, by_own, fit.rows[v].by_common.topRows(observed));
      residuals_.segment(at, observed) = fit.rows[v].residuals.head(observed);
      own_.push_back(by_own * fit.covariance.own[v] * by_own.transpose());
    }
    const Eigen::MatrixXd shared = alone_ * fit.covariance.of_common;
    for (std::size_t o = 0; o < index_.size(); ++o) {
      const Eigen::Index row = 2 * Eigen::Index(o), own = 2 * Eigen::Index(index_[o].observation);
      freedom_.middleRows<2>(row) = Eigen::Matrix2d::Identity() - own_[index_[o].view].block<2, 2>(own, own) -
                                    shared.middleRows<2>(row) * alone_.middleRows<2>(row).transpose();
    }
    removed_.resize(index_.size(), false);
  }

  struct Worst {
    std::size_t observation;
    double decrease;  ///< of chi2 by its removal
  };
  std::optional<Worst> worst() const {
    std::optional<Worst> worst;
    for (std::size_t o = 0; o < index_.size(); ++o) {
      if (removed_[o] || kept_[index_[o].view] <= least_kept_) continue;
      const Eigen::Index row = 2 * Eigen::Index(o);
      const double decrease = decrease_without(residuals_.segment<2>(row), freedom_.middleRows<2>(row));
      if (!worst || decrease > worst->decrease) worst = Worst{o, decrease};
    }
    return worst;
  }

  const ObservationIndex& index(std::size_t observation) const { return index_[observation]; }

  /// False if the fit without it must be made anew: it leaves no freedom.
  bool remove(std::size_t observation) {
    const Eigen::Index row = 2 * Eigen::Index(observation);
    const Eigen::Matrix2d freedom = freedom_.middleRows<2>(row);
    if (!(freedom.determinant() > least_freedom)) return false;
    const auto [view, i] = index_[observation];
    Eigen::MatrixXd effect = alone_ * (fit_.covariance.of_common * alone_.middleRows<2>(row).transpose());
    effect.middleRows(2 * Eigen::Index(first_[view]), own_[view].rows()) +=
        own_[view].middleCols<2>(2 * Eigen::Index(i));
    effect += effects_ * over_freedom(row);
    const Eigen::MatrixXd scaled = effect * freedom.inverse();
    residuals_ += scaled * residuals_.segment<2>(row).eval();
    for (Eigen::Index o = 0; o < freedom_.rows(); o += 2)
      freedom_.middleRows<2>(o) -= scaled.middleRows<2>(o) * effect.middleRows<2>(o).transpose();
    effects_.conservativeResize(Eigen::NoChange, effects_.cols() + 2);
    effects_.rightCols<2>() = effect;
    inverses_.push_back(freedom.inverse());
    removed_[observation] = true;
    --kept_[view];
    return true;
  }

 private:
  /// F_m^-1 U_km^T of every earlier removal m, below each other.
  Eigen::MatrixXd over_freedom(Eigen::Index row) const {
    Eigen::MatrixXd over(effects_.cols(), 2);
    for (std::size_t m = 0; m < inverses_.size(); ++m) {
      const Eigen::Index at = 2 * Eigen::Index(m);
      over.middleRows<2>(at) = inverses_[m] * effects_.block<2, 2>(row, at).transpose();
    }
    return over;
  }

  const Refinement& fit_;
  std::size_t least_kept_;
  std::vector<ObservationIndex> index_;
  std::vector<std::size_t> first_, kept_;  ///< of each view
  std::vector<Eigen::MatrixXd> own_;       ///< J P J^T of each view's observations, the common unknowns fixed
  Eigen::MatrixXd alone_;                  ///< the rows' part that follows the common unknowns
  Eigen::VectorXd residuals_;
  Eigen::Matrix<double, Eigen::Dynamic, 2> freedom_;  ///< of each observation, below each other
  Eigen::MatrixXd effects_;                           ///< U of every removal, beside each other
  std::vector<Eigen::Matrix2d> inverses_;             ///< F_k^-1 of every removal
  std::vector<bool> removed_;
};

/// A fit without some observations, and these.
class Reduced {
 public:
  explicit Reduced(CleanFit clean) : clean_(std::move(clean)) {
    for (const ViewProblem& problem : clean_.problems) {
      std::vector<std::size_t>& own = indices_.emplace_back(problem.observations.size());
      std::iota(own.begin(), own.end(), std::size_t{0});
    }
  }

  const CleanFit& clean() const { return clean_; }

  /// Without these of the present problems, from the largest index on; false where no fit is possible.
  bool remove(std::vector<ObservationIndex> which, const CommonPrior& common) {
    std::ranges::sort(which, std::greater{}, &ObservationIndex::observation);
    CleanFit next = clean_;
    auto indices = indices_;
    for (const auto& [v, i] : which) {
      next.problems[v].observations.erase(next.problems[v].observations.begin() + std::ptrdiff_t(i));
      next.removed.push_back({v, indices[v][i]});
      indices[v].erase(indices[v].begin() + std::ptrdiff_t(i));
    }
    for (std::size_t v = 0; v < next.problems.size(); ++v) next.problems[v].start = clean_.fit.views[v];
    auto fit = refine(next.problems, common);
    if (!fit) return false;
    next.fit = *std::move(fit);
    clean_ = std::move(next);
    indices_ = std::move(indices);
    return true;
  }

 private:
  CleanFit clean_;
  std::vector<std::vector<std::size_t>> indices_;  ///< in the problems before any removal
};

/// The observations up to the first significant removal, to first order; none, if none of `most` is.
std::vector<ObservationIndex> next_outliers(const CleanFit& at, double probability, std::size_t least_kept,
                                            std::size_t most) {
  Removals removals(at.problems, at.fit, least_kept);
  std::vector<ObservationIndex> removed;
  double chi2 = at.fit.chi2;
  int dof = at.fit.dof;
  while (removed.size() < most) {
    const auto worst = removals.worst();
    if (!worst) break;
    removed.push_back(removals.index(worst->observation));
    chi2 -= worst->decrease;
    dof -= 2;
    if (p_value(worst->decrease, chi2, dof) < probability) return removed;
    if (!removals.remove(worst->observation)) break;
  }
  return {};
}

}  // namespace

Expected<CleanFit> refine_without_outliers(const std::vector<ViewProblem>& problems,
                                           const CommonPrior& common, double probability,
                                           std::size_t least_kept) {
  auto fit = refine(problems, common);
  if (!fit) return tl::unexpected<Failure>(fit.error());
  Reduced reduced(CleanFit{problems, *std::move(fit), {}});
  std::size_t left = 0;
  for (const ViewProblem& problem : problems) left += problem.observations.size();
  left /= 3;
  while (probability > 0 && left > 0) {
    const auto outliers = next_outliers(reduced.clean(), probability, least_kept, left);
    if (outliers.empty() || !reduced.remove(outliers, common)) break;
    left -= outliers.size();
  }
  return reduced.clean();
}

}  // namespace helicarm::calibration
