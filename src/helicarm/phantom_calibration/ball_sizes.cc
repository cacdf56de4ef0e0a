// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/ball_sizes.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "helicarm/core/statistics.h"
#include "helicarm/phantom_calibration/correspondence.h"
#include "helicarm/phantom_calibration/diameter_scale.h"

namespace helicarm::phantom_calibration {
namespace {

constexpr double seen_sigma = 0.02;      // of a ball's diameter relative to the others'
constexpr double largest_misfit = 0.08;  // logarithm of seen over listed diameter
constexpr double another_size = 0.18;    // likewise, of a single ball: 4 mm against 4.8 mm
constexpr double most_misfits = 0.25;    // share of balls whose seen diameter another object disturbs
constexpr double clearly_worse = 9;      // chi-square
constexpr double same_scale = 0.03;      // alternatives within it are one

double median_log(std::vector<double> values) {
  for (double& value : values) value = std::log(value);
  return median(std::move(values));
}

/// With the unit adjusted to the assigned sizes, and the chi-square of the sizes.
std::pair<Sizes, double> assigned(const std::vector<double>& seen, const std::vector<double>& listed_mm,
                                  double mm_per_unit) {
  Sizes sizes{mm_per_unit, {}};
  std::vector<double> ratios;
  for (const double diameter : seen) {
    const auto off = [&](double d) { return std::abs(std::log(mm_per_unit * diameter / d)); };
    sizes.diameters_mm.push_back(*std::ranges::min_element(listed_mm, {}, off));
    ratios.push_back(sizes.diameters_mm.back() / diameter);
  }
  sizes.mm_per_unit = std::exp(median_log(ratios));
  double chi2 = 0;
  std::size_t misfits = 0;
  for (const double ratio : ratios) {
    const double off = std::abs(std::log(ratio / sizes.mm_per_unit));
    misfits += off > largest_misfit;
    chi2 += std::pow(std::min(off, largest_misfit) / seen_sigma, 2);
  }
  return {sizes, most_misfits * double(seen.size()) < double(misfits) ? 1e300 : chi2};
}

std::vector<double> sorted_once(std::vector<double> values) {
  std::ranges::sort(values);
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

std::string numbers(const std::vector<double>& mm) { return fmt::format("{:g}", fmt::join(mm, ", ")); }

Failure ambiguous_sizes(const std::vector<Sizes>& alternatives, const std::vector<double>& listed_mm) {
  std::string ways;
  for (const Sizes& sizes : alternatives) {
    ways += fmt::format("{}{}", ways.empty() ? "" : ", or of ", numbers(sorted_once(sizes.diameters_mm)));
  }
  const double ratio = alternatives.front().mm_per_unit / alternatives.back().mm_per_unit;
  return {Reason::uncertain,
          fmt::format(
              "\"diameters_mm\" lists {} mm, and not all of these sizes are found: the balls may be of {} "
              "mm, which makes the phantom up to {:.3g} times as large. List the sizes that the phantom "
              "has and no other, or give a distance measured by hand",
              numbers(listed_mm), ways, ratio),
          {},
          {{"alternatives", double(alternatives.size())}, {"ratio", ratio}}};
}

/// Alternatives that a distance by hand or the receiver's distance from the source leaves.
std::vector<Sizes> possible_by_distances(std::vector<Sizes> alternatives, double largest_factor,
                                         std::optional<double> factor_by_hand) {
  constexpr double margin = 0.05;
  if (alternatives.size() > 1 && factor_by_hand) {
    const auto off = [&](const Sizes& sizes) {
      return std::abs(std::log(sizes.mm_per_unit / *factor_by_hand));
    };
    return {*std::ranges::min_element(alternatives, {}, off)};
  }
  if (alternatives.size() > 1)
    std::erase_if(alternatives,
                  [&](const Sizes& sizes) { return sizes.mm_per_unit > (1 + margin) * largest_factor; });
  return alternatives;
}

}  // namespace

std::vector<Sizes> possible_sizes(const std::vector<double>& seen, const std::vector<double>& listed_mm) {
  std::vector<std::pair<Sizes, double>> found;
  double best = 1e300;
  for (const double diameter : seen)
    for (const double mm : listed_mm) {
      auto one = assigned(seen, listed_mm, mm / diameter);
      if (one.second == 1e300) continue;
      best = std::min(best, one.second);
      const auto same = std::ranges::find_if(found, [&](const auto& known) {
        return std::abs(std::log(known.first.mm_per_unit / one.first.mm_per_unit)) < same_scale;
      });
      if (same == found.end())
        found.push_back(std::move(one));
      else if (one.second < same->second)
        *same = std::move(one);
    }
  std::vector<Sizes> sizes;
  for (auto& [one, chi2] : found)
    if (chi2 - best < clearly_worse) sizes.push_back(std::move(one));
  std::ranges::sort(sizes, std::greater{}, &Sizes::mm_per_unit);
  return sizes;
}

Expected<void> settle_sizes(AdjustedViews& found, const std::vector<pipeline::RectifiedView>& detected,
                            const pipeline::Case& the_case, std::optional<double> factor_by_hand,
                            std::vector<Warning>& warnings) {
  const double factor = diameter_scale(found).factor;
  std::vector<double> seen;
  for (std::size_t i = 0; const auto& diameter : seen_diameters(found)) {
    seen.push_back(diameter.value_or(found.diameters_mm[i] / factor));
    ++i;
  }
  const std::vector<double> listed = sorted_once(the_case.diameters_mm);
  const auto alternatives = possible_by_distances(
      possible_sizes(seen, listed), depth_limits(found, detected).largest_factor, factor_by_hand);
  if (alternatives.size() > 1) return tl::unexpected<Failure>(ambiguous_sizes(alternatives, listed));
  if (alternatives.size() == 1) found.diameters_mm = alternatives[0].diameters_mm;
  for (const double mm : listed)
    if (std::ranges::find(found.diameters_mm, mm) == found.diameters_mm.end())
      warnings.push_back(
          {Reason::not_seen,
           fmt::format("\"diameters_mm\" lists {:g} mm, but no ball of this size is found: its "
                       "balls are missing, or the list is wrong and with it the scale",
                       mm),
           {},
           {{"diameter_mm", mm}}});
  const double scale = diameter_scale(found).factor;
  for (std::size_t i = 0; i < seen.size(); ++i)
    if (std::abs(std::log(scale * seen[i] / found.diameters_mm[i])) > another_size)
      warnings.push_back(
          {Reason::scale_disagrees,
           fmt::format("{} appears {:.2f} mm large, but \"diameters_mm\" lists {} mm: list all sizes",
                       found.labels[i], scale * seen[i], numbers(listed)),
           {},
           {{"seen_mm", scale * seen[i]}, {"taken_as_mm", found.diameters_mm[i]}}});
  return {};
}

std::vector<Warning> sizes_stated_twice(const pipeline::Case& the_case) {
  std::vector<double> of_file;
  for (const phantom::CalibratorBall& ball : the_case.calibrator.balls) of_file.push_back(ball.diameter_mm);
  of_file = sorted_once(std::move(of_file));
  const std::vector<double> listed = sorted_once(the_case.diameters_mm);
  if (of_file.empty() || listed.empty() || of_file == listed) return {};
  return {
      {Reason::scale_disagrees,
       fmt::format("case.json: \"diameters_mm\" lists {} mm, the balls of its calibrator \"{}\" have {} mm: "
                   "correct one of the two",
                   numbers(listed), the_case.calibrator.name, numbers(of_file)),
       {},
       {}}};
}

}  // namespace helicarm::phantom_calibration
