// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/first_appearance.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/detection/find_dots.h"

namespace helicarm::track {
namespace {

/// A picked marker as one appearance fits it.
struct FittedMarker {
  double misfit;    ///< rms of the residual over the contrast
  double residual;  ///< rms, grey levels: a contrast that grows with the blur does not hide it
  double size;      ///< logarithm of the fitted over the stated radius
};

/// What one appearance makes of the picked markers of a view.
struct TriedAppearance {
  MarkerAppearance appearance;
  std::map<std::size_t, FittedMarker> markers;

  double size() const {
    std::vector<double> sizes;
    for (const auto& [marker, fitted] : markers) sizes.push_back(fitted.size);
    return median(std::move(sizes));
  }
  /// Of the median size, without those of other discs.
  double sigma() const {
    std::vector<double> off;
    for (const auto& [marker, fitted] : markers) off.push_back(std::abs(fitted.size - size()));
    return 1.25 * 1.4826 * median(std::move(off)) / std::sqrt(double(markers.size()));
  }
};

/// Of each marker the least residual that any appearance leaves.
std::map<std::size_t, double> least_residuals(const std::vector<TriedAppearance>& all) {
  std::map<std::size_t, double> least;
  for (const TriedAppearance& tried : all)
    for (const auto& [marker, fitted] : tried.markers) {
      const auto [at, is_new] = least.emplace(marker, fitted.residual);
      at->second = std::min(at->second, fitted.residual);
    }
  return least;
}

/// Mean logarithm of the residuals over the least that any appearance leaves of the same marker.
double excess_of(const TriedAppearance& tried, const std::map<std::size_t, double>& least) {
  constexpr double most = 0.3;  // another disc
  double sum = 0;
  for (const auto& [marker, fitted] : tried.markers)
    sum += std::min(most, std::log(fitted.residual / least.at(marker)));
  return sum / double(tried.markers.size());
}

/// `all` of one polarity.
SizeRange size_range(const std::vector<TriedAppearance>& all) {
  // A likelihood ratio of e^8 over some 80 pixels a marker, and what no profile explains.
  constexpr double as_good = 0.1, model = 0.015;
  const auto least = least_residuals(all);
  SizeRange range;
  for (const TriedAppearance& tried : all) range.markers = std::max(range.markers, tried.markers.size());
  const auto is_enough = [&](const TriedAppearance& tried) {
    return 2 * tried.markers.size() >= range.markers;
  };
  double best = 1e9;
  for (const TriedAppearance& tried : all)
    if (is_enough(tried)) best = std::min(best, excess_of(tried, least));
  range.low = 1e9, range.high = -1e9;
  for (const TriedAppearance& tried : all)
    if (is_enough(tried) &&
        excess_of(tried, least) <= best + std::max(model, as_good / double(tried.markers.size()))) {
      range.low = std::min(range.low, tried.size());
      range.high = std::max(range.high, tried.size());
      range.sigma = std::max(range.sigma, tried.sigma());
    }
  return range;
}

/// That of the appearance that fits most markers; of those, the nearest.
double likely_polarity(const std::vector<TriedAppearance>& all) {
  double polarity = 1, nearest = 1e9;
  std::size_t most = 0;
  for (const TriedAppearance& tried : all) {
    std::vector<double> misfits;
    for (const auto& [marker, fitted] : tried.markers) misfits.push_back(fitted.misfit);
    const std::size_t count = misfits.size();
    const double misfit = median(std::move(misfits)) / double(count);
    if (count > most + 1 || (count + 1 >= most && misfit < nearest))
      polarity = tried.appearance.polarity, nearest = misfit;
    most = std::max(most, count);
  }
  return polarity;
}

/// `all` of one polarity.
MarkerAppearance likely_appearance(const std::vector<TriedAppearance>& all) {
  constexpr double by_size = 0.1, by_missing = 0.3;  // against the mean logarithm of the residuals
  const auto least = least_residuals(all);
  std::size_t most = 0;
  for (const TriedAppearance& tried : all) most = std::max(most, tried.markers.size());
  MarkerAppearance best;
  double lowest = 1e9;
  for (const TriedAppearance& tried : all) {
    const auto missing = double(most - tried.markers.size());
    if (missing > 1) continue;
    const double cost =
        excess_of(tried, least) + by_missing * missing / double(most) + by_size * std::abs(tried.size());
    if (cost >= lowest) continue;
    lowest = cost;
    best = tried.appearance;
    best.radius_factor = std::exp(tried.size());
  }
  return best;
}

TriedAppearance tried(const MarkerAppearance& appearance, const xray::XrayImage& image,
                      std::span<const PickedPlace> picks, double reach_px) {
  TriedAppearance made{appearance, {}};
  for (const PickedPlace& pick : picks)
    if (const auto found =
            picked_marker(image, pick.uv_raw, pick.radius_px, reach_px + pick.radius_px, appearance))
      made.markers[pick.marker] = {found->misfit,
                                   std::max(1e-9, found->misfit * std::abs(found->image.contrast)),
                                   std::log(found->image.radius_px / pick.radius_px)};
  return made;
}

}  // namespace

LearntAppearance learnt_appearance(const xray::XrayImage& image, std::span<const PickedPlace> picks,
                                   double reach_px) {
  std::vector<TriedAppearance> all;
  MarkerAppearance appearance;
  appearance.options = detection::fit_options_for(image);
  for (const double polarity : {1.0, -1.0})
    for (const double absorbance : {0.8, 8.0})  // like the chord's length, and a flat disc
      for (const double blur : profile_blurs()) {
        appearance.polarity = polarity;
        appearance.profile = detection::BallProfile(blur, absorbance);
        if (auto made = tried(appearance, image, picks, reach_px); !made.markers.empty())
          all.push_back(std::move(made));
      }
  LearntAppearance learnt;
  learnt.appearance.options = appearance.options;
  if (all.empty()) return learnt;
  const double polarity = likely_polarity(all);
  std::erase_if(all, [&](const TriedAppearance& one) { return one.appearance.polarity != polarity; });
  learnt.appearance = likely_appearance(all);
  learnt.sizes = size_range(all);
  return learnt;
}

/// Nothing where a view's discs agree with the stated size, or are too few.
std::optional<Warning> size_contradiction(const std::vector<SizeRange>& views, double diameter_mm) {
  constexpr std::size_t fewest = 3;
  constexpr double model = 0.12;  // what profiles that fit alike leave open beyond the range
  double low = -1e9, high = 1e9;
  std::size_t used = 0;
  for (const SizeRange& range : views) {
    if (range.markers < fewest) continue;
    const double bound = model + 2 * range.sigma;
    low = std::max(low, range.low - bound);
    high = std::min(high, range.high + bound);
    if (range.low - bound <= 0 && range.high + bound >= 0) return std::nullopt;
    ++used;
  }
  if (used == 0 || low > high || (low <= 0 && high >= 0)) return std::nullopt;
  return Warning{
      Reason::scale_disagrees,
      fmt::format("\"diameter_mm\" is {:g}, the markers' images are those of {:.2f} to {:.2f} mm: measure "
                  "a marker and correct it; sizes and contrasts are judged by it",
                  diameter_mm, diameter_mm * std::exp(low), diameter_mm * std::exp(high)),
      {},
      {{"stated_mm", diameter_mm},
       {"low_mm", diameter_mm * std::exp(low)},
       {"high_mm", diameter_mm * std::exp(high)}}};
}

}  // namespace helicarm::track
