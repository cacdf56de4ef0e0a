// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/image_errors.h"

#include <algorithm>
#include <cmath>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/ray.h"

namespace helicarm::track {
namespace {

constexpr double median_of_chi2 = 0.4549;  // one degree of freedom

}  // namespace

std::vector<double> sigma_factors(SequenceData& work) {
  constexpr double shared_frames = 30, least = 0.7, most = 10;
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
    const double robust = median(values) / median_of_chi2;
    double sum = 0;
    for (const double value : values) sum += std::min(value, 12 * robust);
    return std::max(robust, sum / double(values.size()));
  };
  std::vector<double> factors(work.markers, 1);
  if (all.size() < 5) return factors;
  const double pooled = variance(all);
  for (std::size_t m = 0; m < work.markers; ++m) {
    const auto count = double(ratios[m].size());
    const double own = ratios[m].empty() ? pooled : variance(ratios[m]);
    factors[m] =
        std::clamp(std::sqrt((count * own + shared_frames * pooled) / (count + shared_frames)), least, most);
  }
  for (auto& frame : work.sights)
    for (std::size_t m = 0; m < work.markers; ++m)
      for (auto& sight : frame[m])
        if (sight) sight->sigma_px *= factors[m];
  return factors;
}

double correlation_of(const SequenceData& work) {
  constexpr double most = 0.8, least_pairs = 50, cut = 4;
  double products = 0, squares = 0, pairs = 0;
  for (std::size_t m = 0; m < work.markers; ++m) {
    std::optional<double> before;
    for (std::size_t f = 0; f < work.frames; ++f) {
      std::optional<double> now;
      const auto &first = work.sights[f][m][0], &other = work.sights[f][m][1];
      if (work.points[f][m] && first && other) {
        const geometry::Ray from = geometry::ray_through(*first->view, first->uv),
                            to = geometry::ray_through(*other->view, other->uv);
        const double sign = (to.origin - from.origin).dot(from.direction.cross(to.direction)) > 0 ? 1 : -1;
        now = std::clamp(sign * std::sqrt(work.points[f][m]->chi2), -cut, cut);
      }
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
