// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/ball_offsets.h"

#include <cmath>
#include <map>

#include "helicarm/core/statistics.h"

namespace helicarm::calibration {
namespace {

constexpr double most_tolerance_mm = 0.5;  // above it the file describes another calibrator
constexpr double least_tolerance_mm = 0.02;
constexpr double tolerance_step = 1.3;
constexpr double consistent_excess = 0.5;  // standard deviations of chi2: consistent below it

std::size_t count_of(const std::vector<ViewProblem>& problems) {
  std::size_t count = 0;
  for (const ViewProblem& problem : problems) count += problem.observations.size();
  return count;
}

std::vector<ViewProblem> without_offsets(std::vector<ViewProblem> problems) {
  for (ViewProblem& problem : problems)
    for (Observation& observation : problem.observations) {
      observation.offset_root.resize(3, 0);
      observation.first_offset = 0;
    }
  return problems;
}

std::vector<ViewProblem> with_tolerance(std::vector<ViewProblem> problems, double tolerance_mm) {
  for (ViewProblem& problem : problems)
    for (Observation& observation : problem.observations) {
      observation.offset_root = tolerance_mm * Eigen::Matrix3d::Identity();
      observation.first_offset = 3 * Eigen::Index(observation.ball);
    }
  return problems;
}

/// Laplace approximation, up to a common constant.
double log_likelihood(const Refinement& fit) {
  return -0.5 * fit.chi2 + 0.5 * fit.covariance.log_determinant;
}

/// For independent errors of the image points, all inflated by one factor.
std::optional<double> log_likelihood_enlarged(std::vector<ViewProblem> problems, const CommonPrior& common) {
  problems = without_offsets(std::move(problems));
  const auto exact = refine(problems, common);
  if (!exact) return std::nullopt;
  const double factor = std::sqrt(std::max(1.0, exact->chi2 / exact->dof));
  for (ViewProblem& problem : problems)
    for (Observation& observation : problem.observations) observation.sigma_px *= factor;
  const auto enlarged = refine(problems, common);
  if (!enlarged) return std::nullopt;
  return log_likelihood(*enlarged) - 2.0 * double(count_of(problems)) * std::log(factor);
}

}  // namespace

bool rejects_many(const CleanFit& clean, const std::vector<ViewProblem>& problems) {
  return clean.removed.size() > std::max(problems.size(), count_of(problems) / 10);
}

std::optional<OffsetFit> fit_ball_offsets(const std::vector<ViewProblem>& problems, const CommonPrior& common,
                                          double probability, std::size_t least_kept) {
  for (double tolerance = least_tolerance_mm; tolerance <= most_tolerance_mm; tolerance *= tolerance_step) {
    auto clean =
        refine_without_outliers(with_tolerance(problems, tolerance), common, probability, least_kept);
    if (!clean || rejects_many(*clean, problems)) continue;
    if (clean->fit.dof < 1 || chi2_excess(clean->fit.chi2, clean->fit.dof) > consistent_excess) continue;
    const auto enlarged = log_likelihood_enlarged(clean->problems, common);
    if (!enlarged || log_likelihood(clean->fit) <= *enlarged) return std::nullopt;
    return OffsetFit{*std::move(clean), tolerance};
  }
  return std::nullopt;
}

double rms_offset_mm(const std::vector<ViewProblem>& problems, const Refinement& fit) {
  std::map<std::size_t, double> squared;
  for (const ViewProblem& problem : problems)
    for (const Observation& observation : problem.observations)
      if (!observation.offset_root.isZero(0))
        squared[observation.ball] =
            (observation.offset_root *
             fit.common.segment(observation.first_offset, observation.offset_root.cols()))
                .squaredNorm();
  double sum = 0;
  for (const auto& [ball, squared_length] : squared) sum += squared_length / double(squared.size());
  return std::sqrt(sum);
}

}  // namespace helicarm::calibration
