// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_variations.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include <fmt/format.h>

namespace helicarm::calibration {
namespace {

constexpr double drop_at_95 = 1.92;  // half the 95 % quantile of chi-square with one degree of freedom
constexpr double impossible = -std::numeric_limits<double>::infinity();

/// Standard deviations from 0 on, then by factors of 2.
std::vector<double> ladder(double of_view, int lowest, int highest) {
  std::vector<double> values{0};
  for (int power = lowest; power <= highest; ++power) values.push_back(of_view * std::exp2(power));
  return values;
}

/// Where the profile, over the logarithm from the second step on, reaches `level` between two steps.
double crossing(const std::vector<double>& at, const std::vector<double>& profile, std::size_t i,
                double level) {
  const double share = (level - profile[i]) / (profile[i + 1] - profile[i]);
  return i == 0 ? share * at[1] : at[i] * std::pow(at[i + 1] / at[i], share);
}

/// The vertex of the parabola through the highest step and those beside it.
double vertex(const std::vector<double>& at, const std::vector<double>& profile, std::size_t best) {
  if (best < 2 || best + 1 == at.size()) return at[best];
  const double before = profile[best - 1], after = profile[best + 1];
  const double bend = before - 2 * profile[best] + after;
  return bend < 0 ? at[best] * std::exp2(0.5 * (before - after) / bend) : at[best];
}

VariationEstimate estimate_of(const std::vector<double>& at, const std::vector<double>& profile) {
  const auto best = std::size_t(std::ranges::max_element(profile) - profile.begin());
  const double level = profile[best] - drop_at_95;
  VariationEstimate estimate{vertex(at, profile, best), 0, {}};
  for (std::size_t i = best; i-- > 0;)
    if (profile[i] < level) {
      estimate.low_mm = crossing(at, profile, i, level);
      break;
    }
  for (std::size_t i = best; i + 1 < at.size(); ++i)
    if (profile[i + 1] < level) {
      estimate.high_mm = crossing(at, profile, i, level);
      break;
    }
  return estimate;
}

VariationEstimates estimates_of(CArmModel model, CArmVariation CArmModel::*kind, double of_view) {
  const std::vector<double> smooth = ladder(of_view, -6, 5), repeat = ladder(of_view, -8, 2);
  std::vector<double> of_smooth(smooth.size(), impossible), of_repeat(repeat.size(), impossible);
  for (std::size_t s = 0; s < smooth.size(); ++s)
    for (std::size_t r = 0; r < repeat.size(); ++r) {
      model.*kind = {smooth[s], repeat[r]};
      const double likelihood = std::max(log_likelihood(model), std::numeric_limits<double>::lowest());
      of_smooth[s] = std::max(of_smooth[s], likelihood);
      of_repeat[r] = std::max(of_repeat[r], likelihood);
    }
  return {estimate_of(smooth, of_smooth), estimate_of(repeat, of_repeat)};
}

}  // namespace

CArmVariations c_arm_variations(const CArmModel& model) {
  if (model.entries.empty()) return {};
  CArmVariations made{estimates_of(model, &CArmModel::focal, model.unknown.focal->of_view),
                      estimates_of(model, &CArmModel::principal, model.unknown.principal->of_view),
                      {}};
  std::vector<HistoryEntry> placed;
  for (const HistoryEntry& entry : model.entries)
    if (entry.primary_deg) placed.push_back(entry);
  if (placed.empty()) return made;
  const Eigen::VectorXd mean = predict_intrinsics(model, placed).mean_mm;
  const Eigen::Matrix3Xd by_axis = mean.reshaped(3, Eigen::Index(placed.size()));
  made.at_positions = {by_axis.rowwise().minCoeff(), by_axis.rowwise().maxCoeff()};
  return made;
}

std::string text_of(const VariationEstimate& estimate) {
  if (!estimate.is_determined()) return "not determined by these data";
  if (!estimate.high_mm) return fmt::format("above {:.2g} mm", estimate.low_mm);
  if (estimate.low_mm == 0) return fmt::format("below {:.2g} mm", *estimate.high_mm);
  return fmt::format("{:.2g} mm ({:.2g} to {:.2g})", estimate.sigma_mm, estimate.low_mm, *estimate.high_mm);
}

}  // namespace helicarm::calibration
