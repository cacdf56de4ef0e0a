// SPDX-License-Identifier: Apache-2.0
#include "helicarm/localization/pick_checks.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"

namespace helicarm::localization {
namespace {

double excess_of(const LocatedPoint& point) { return point.chi2 / double(2 * point.views.size() - 3); }

}  // namespace

std::optional<Warning> pixels_taken_as_rectified(std::span<const PointObservation> picks,
                                                 const calibration::SavedCalibration& calibration) {
  constexpr double least_px = 0.05;
  double sum = 0, largest = 0;
  int count = 0;
  for (const PointObservation& pick : picks) {
    if (pick.view >= calibration.maps.size() || !calibration.maps[pick.view]) continue;
    const auto raw = rectification::raw_in_image(*calibration.maps[pick.view], pick.uv);
    if (!raw) continue;
    const double apart = (*raw - pick.uv).norm();
    sum += apart;
    largest = std::max(largest, apart);
    ++count;
  }
  if (largest < least_px) return std::nullopt;
  const double mean = sum / count;
  return Warning{
      Reason::pixels_taken_as_rectified,
      fmt::format("the pixels are taken as rectified ones: at these {} picks raw pixels are {:.2g} px from "
                  "them on average, {:.2g} px at most; for pixels of the stored images give --raw (Python: "
                  "raw=True)",
                  count, mean, largest),
      {},
      {{"mean_px", mean}, {"max_px", largest}, {"picks", double(count)}}};
}

void inflate_if_views_contradict(std::span<Expected<LocatedPoint>> points) {
  std::vector<double> excesses;
  std::size_t missing = 0;
  for (const Expected<LocatedPoint>& point : points) {
    if (!point) continue;
    excesses.push_back(excess_of(*point));
    missing += point->missing_rays ? 1 : 0;
  }
  if (2 * missing <= excesses.size()) return;
  const double typical = quantile(excesses, 0.5);
  for (Expected<LocatedPoint>& point : points) {
    if (!point) continue;
    const double factor = typical / (point->missing_rays ? excess_of(*point) : 1);
    if (factor > 1) {
      point->covariance_in_anchor *= factor;
      point->by_calibration *= std::sqrt(factor);
    }
    if (point->missing_rays) continue;
    point->missing_rays = Warning{
        Reason::residual_too_large,
        fmt::format(
            "\"{}\": the rays of {} of {} points miss each other by more than their errors explain: the "
            "views "
            "contradict each other, or the picks are wrong, and the errors of all points are enlarged {:.3g} "
            "times; check the calibration, the picks and --raw",
            point->name, missing, excesses.size(), std::sqrt(typical)),
        {},
        {{"ray_gap_mm", point->ray_gap_mm}, {"chi2", point->chi2}, {"missing", double(missing)}}};
  }
}

}  // namespace helicarm::localization
