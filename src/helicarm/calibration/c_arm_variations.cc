// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_variations.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include <fmt/format.h>

namespace helicarm::calibration {
namespace {

constexpr double drop_at_95 = 1.92;  // half the 95 % quantile of chi-square with one degree of freedom

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

/// The parabola through the highest step and those beside it, over factors of 2 from that step.
struct Peak {
  double at = 0, height = 0;
  std::optional<double> reach = {};  ///< from there to the ends of the 95 % interval; nothing: no parabola
};

Peak peak_of(const std::vector<double>& profile, std::size_t best) {
  if (best < 2 || best + 1 == profile.size()) return {0, profile[best]};
  const double before = profile[best - 1], after = profile[best + 1];
  const double slope = 0.5 * (after - before), bend = 0.5 * (before + after) - profile[best];
  if (!(bend < 0) || !std::isfinite(bend)) return {0, profile[best]};
  return {-0.5 * slope / bend, profile[best] - 0.25 * slope * slope / bend, std::sqrt(-drop_at_95 / bend)};
}

double greatest(const std::vector<double>& profile) {
  return peak_of(profile, std::size_t(std::ranges::max_element(profile) - profile.begin())).height;
}

VariationEstimate estimate_of(const std::vector<double>& at, const std::vector<double>& profile) {
  const auto best = std::size_t(std::ranges::max_element(profile) - profile.begin());
  const Peak peak = peak_of(profile, best);
  const double level = peak.height - drop_at_95;
  VariationEstimate estimate{at[best] * std::exp2(peak.at), 0, {}};
  constexpr double most_reach = 1.5;  // beyond, the steps themselves are dense enough
  if (peak.reach && *peak.reach < most_reach) {
    estimate.low_mm = at[best] * std::exp2(peak.at - *peak.reach);
    estimate.high_mm = at[best] * std::exp2(peak.at + *peak.reach);
    return estimate;
  }
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
  std::vector<std::vector<double>> by_smooth(smooth.size(), std::vector<double>(repeat.size())),
      by_repeat(repeat.size(), std::vector<double>(smooth.size()));
  for (std::size_t s = 0; s < smooth.size(); ++s)
    for (std::size_t r = 0; r < repeat.size(); ++r) {
      model.*kind = {smooth[s], repeat[r]};
      by_smooth[s][r] = by_repeat[r][s] =
          std::max(log_likelihood(model), std::numeric_limits<double>::lowest());
    }
  std::vector<double> of_smooth, of_repeat;
  for (const std::vector<double>& row : by_smooth) of_smooth.push_back(greatest(row));
  for (const std::vector<double>& row : by_repeat) of_repeat.push_back(greatest(row));
  return {estimate_of(smooth, of_smooth), estimate_of(repeat, of_repeat)};
}

}  // namespace

CArmVariations c_arm_variations(const CArmModel& model) {
  if (model.entries.empty()) return {};
  CArmVariations variations{estimates_of(model, &CArmModel::focal, model.unknown.focal->of_view),
                            estimates_of(model, &CArmModel::principal, model.unknown.principal->of_view),
                            {}};
  std::vector<HistoryEntry> placed;
  for (const HistoryEntry& entry : model.entries)
    if (entry.primary_deg) {
      placed.push_back(entry);
      placed.back().nominal_focal_mm.reset();  // of one source distance
    }
  if (placed.empty()) return variations;
  const Eigen::VectorXd mean = predict_intrinsics(model, placed).mean_mm;
  const Eigen::Matrix3Xd by_axis = mean.reshaped(3, Eigen::Index(placed.size()));
  variations.at_positions = {by_axis.rowwise().minCoeff(), by_axis.rowwise().maxCoeff()};
  return variations;
}

std::string text_of(const VariationEstimate& estimate) {
  if (!estimate.is_determined()) return "not determined by these data";
  if (!estimate.high_mm) return fmt::format("above {:.2g} mm", estimate.low_mm);
  if (estimate.low_mm == 0) return fmt::format("below {:.2g} mm", *estimate.high_mm);
  return fmt::format("{:.2g} mm ({:.2g} to {:.2g})", estimate.sigma_mm, estimate.low_mm, *estimate.high_mm);
}

}  // namespace helicarm::calibration
