// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/image_errors.h"

#include <algorithm>
#include <cmath>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/ray.h"

namespace helicarm::track {
namespace {

constexpr double median_of_chi2_1 = 0.4549;  // one degree of freedom

/// Squares of ray gaps in image units, beside the variances that the fits state.
struct Gap {
  double square, variance;
};

/// What texture behind the markers and their motion displace a sharp image by, which its fit does not show:
/// factor and floor of the fits' standard deviations with the largest likelihood.
double floor_of(const std::vector<Gap>& gaps) {
  constexpr double least_factor = 0.7, most_factor = 3, most_px = 0.2, farthest = 16;
  double best = 0, most = -1e300;
  for (double floor = 0; floor <= most_px; floor = 1.15 * floor + 0.005)
    for (double factor = least_factor; factor <= most_factor; factor *= 1.1) {
      double likelihood = 0;
      for (const Gap& gap : gaps) {
        const double variance = factor * factor * gap.variance + 2 * floor * floor;
        likelihood -= 0.5 * (std::log(variance) + std::min(farthest, gap.square / variance));
      }
      if (likelihood > most) most = likelihood, best = floor;
    }
  return best;
}

/// The floor is in the sights afterwards.
void raise_to_floor(SequenceData& work) {
  constexpr std::size_t least_gaps = 50;
  std::vector<Gap> gaps;
  for (std::size_t f = 0; f < work.frames; ++f)
    for (std::size_t m = 0; m < work.markers; ++m)
      if (const auto seen = work.seen(f, m); work.points[f][m] && seen.size() == 2) {
        const double variance = std::pow(seen[0].sigma_px, 2) + std::pow(seen[1].sigma_px, 2);
        gaps.push_back({work.points[f][m]->chi2 * variance, variance});
      }
  if (gaps.size() < least_gaps) return;
  const double floor = floor_of(gaps);
  for (auto& frame : work.sights)
    for (auto& marker : frame)
      for (auto& sight : marker)
        if (sight) sight->sigma_px = std::hypot(sight->sigma_px, floor);
  locate_all(work);
}

/// Ray gap of the first two views in standard deviations, with the side on which the rays pass.
std::optional<double> signed_gap(const SequenceData& work, std::size_t f, std::size_t m) {
  const auto &first = work.sights[f][m][0], &other = work.sights[f][m][1];
  if (!work.points[f][m] || !first || !other) return std::nullopt;
  const geometry::Ray from = geometry::ray_through(*first->view, first->uv),
                      to = geometry::ray_through(*other->view, other->uv);
  const double sign = (to.origin - from.origin).dot(from.direction.cross(to.direction)) > 0 ? 1 : -1;
  return sign * std::sqrt(work.points[f][m]->chi2);
}

/// Squares of the gaps in standard deviations, and the part that a marker's gaps have in common.
struct GapSquares {
  double all = 0, common = 0, count = 0, markers = 0;
  bool is_enough() const { return markers >= 2 && all > 0; }
  double share() const { return std::clamp(common / all, 0.0, 1.0); }
};

GapSquares gap_squares(const SequenceData& work) {
  GapSquares squares;
  for (std::size_t m = 0; m < work.markers; ++m) {
    double sum = 0, of_marker = 0, n = 0;
    for (std::size_t f = 0; f < work.frames; ++f)
      if (const auto gap = signed_gap(work, f, m)) sum += *gap, of_marker += *gap * *gap, ++n;
    if (n < 2) continue;
    squares.all += of_marker;
    squares.count += n;
    squares.common += (sum * sum - of_marker) / (n - 1);
    ++squares.markers;
  }
  return squares;
}

/// By how much a 95 % band is wider because the errors' variance is itself estimated: by as many independent
/// gaps as the part that a marker's gaps have in common (texture moves with it) leaves.
double few_gaps_factor(const SequenceData& work) {
  constexpr double z = normal_at_975, fewest = 4;
  const GapSquares squares = gap_squares(work);
  if (!squares.is_enough()) return 1;
  const double per_marker = squares.count / squares.markers;
  const double independent = std::max(fewest, squares.count / (1 + (per_marker - 1) * squares.share()));
  return 1 + (z * z + 1) / (4 * independent);  // Student's quantile over the normal one
}

}  // namespace

std::vector<double> sigma_factors(SequenceData& work) {
  constexpr double shared_frames = 30, least = 0.7, most = 10;
  raise_to_floor(work);
  std::vector<std::vector<double>> ratios(work.markers);
  std::vector<double> all;
  for (std::size_t f = 0; f < work.frames; ++f)
    for (std::size_t m = 0; m < work.markers; ++m)
      if (const auto& point = work.points[f][m]; point && work.seen(f, m).size() == 2) {
        ratios[m].push_back(point->chi2);
        all.push_back(point->chi2);
      }
  // Between the median, which outliers do not reach, and the mean, which holds the bands' coverage.
  const auto variance = [](std::vector<double> values) {
    const double robust = median(values) / median_of_chi2_1;
    double sum = 0;
    for (const double value : values) sum += std::min(value, 12 * robust);
    return std::max(robust, sum / double(values.size()));
  };
  std::vector<double> factors(work.markers, 1);
  if (all.size() < 5) return factors;
  const double pooled = variance(all), widened = few_gaps_factor(work);
  for (std::size_t m = 0; m < work.markers; ++m) {
    const auto count = double(ratios[m].size());
    const double own = ratios[m].empty() ? pooled : variance(ratios[m]);
    // The gaps show one direction of two or more: a marker whose gaps are small has the errors of the others.
    const double shared = (count * own + shared_frames * pooled) / (count + shared_frames);
    factors[m] = std::clamp(widened * std::sqrt(std::max(pooled, shared)), least, most);
  }
  for (auto& frame : work.sights)
    for (std::size_t m = 0; m < work.markers; ++m)
      for (auto& sight : frame[m])
        if (sight) sight->sigma_px *= factors[m];
  return factors;
}

double lasting_share(const SequenceData& work) {
  constexpr double usual = 0.3;
  const GapSquares squares = gap_squares(work);
  return squares.is_enough() ? squares.share() : usual;
}

double correlation_of(const SequenceData& work) {
  constexpr double most = 0.8, least_pairs = 50, cut = 4;
  double products = 0, squares = 0, pairs = 0;
  for (std::size_t m = 0; m < work.markers; ++m) {
    std::optional<double> before;
    for (std::size_t f = 0; f < work.frames; ++f) {
      auto now = signed_gap(work, f, m);
      if (now) now = std::clamp(*now, -cut, cut);
      if (now && before) {
        products += *now * *before;
        squares += 0.5 * (*now * *now + *before * *before);
        ++pairs;
      }
      before = now;
    }
  }
  return pairs < least_pairs ? 0.3 : std::clamp(products / squares, 0.0, most);
}

}  // namespace helicarm::track
