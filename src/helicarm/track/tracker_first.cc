// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/detection/find_dots.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/tracker.h"

namespace helicarm::track {

namespace {

/// A picked marker as one appearance fits it.
struct FittedMarker {
  double residual;  ///< rms, grey levels: a contrast that grows with the blur does not hide it
  double size;      ///< logarithm of the fitted over the stated radius
};

/// What one appearance makes of the picked markers of a view.
struct TriedAppearance {
  double polarity;
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

/// Logarithms of the sizes that fit as well as the best: a blurred small disc looks almost like a sharp large
/// one.
struct SizeRange {
  double low = 0, high = 0, sigma = 0;
  std::size_t markers = 0;
};

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
  std::map<std::size_t, double> least;
  for (const TriedAppearance& tried : all)
    for (const auto& [marker, fitted] : tried.markers) {
      const auto [at, is_new] = least.emplace(marker, fitted.residual);
      at->second = std::min(at->second, fitted.residual);
    }
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

}  // namespace

void Tracker::learn_appearance(const std::vector<xray::XrayImage>& images) {
  constexpr double click_px = 6;
  std::vector<SizeRange> sizes_of_views;
  for (std::size_t k = 0; k < cameras_.size(); ++k) {
    std::vector<TriedAppearance> all;
    MarkerAppearance best;
    double least = 1e9;
    std::size_t most = 0;
    for (const double polarity : {1.0, -1.0})
      for (const double absorbance : {0.8, 8.0})  // like the chord's length, and a flat disc
        for (const double blur : profile_blurs()) {
          MarkerAppearance tried;
          tried.polarity = polarity;
          tried.profile = detection::BallProfile(blur, absorbance);
          tried.options = detection::fit_options_for(images[k]);
          std::vector<double> misfits, sizes;
          TriedAppearance fits{polarity, {}};
          for (const MarkerPick& pick : given_->picks) {
            if (pick.view != k) continue;
            const double radius = radius_px(k, markers_[pick.marker].place);
            if (const auto found = picked_marker(images[k], pick.uv_raw, radius, click_px + radius, tried)) {
              misfits.push_back(found->misfit);
              sizes.push_back(std::log(found->image.radius_px / radius));
              fits.markers[pick.marker] = {std::max(1e-9, found->misfit * std::abs(found->image.contrast)),
                                           sizes.back()};
            }
          }
          if (misfits.empty()) continue;
          all.push_back(std::move(fits));
          if (misfits.size() + 1 < most) continue;
          // A blurred small disc looks like a sharp large one: of what fits, the stated size decides.
          const double misfit = (median(misfits) + 0.1 * std::abs(median(sizes))) / double(misfits.size());
          if (misfits.size() > most + 1 || misfit < least) {
            least = misfit;
            best = tried;
            best.radius_factor = std::exp(median(sizes));
          }
          most = std::max(most, misfits.size());
        }
    if (most == 0) best.options = detection::fit_options_for(images[k]);
    std::erase_if(all, [&](const TriedAppearance& tried) { return tried.polarity != best.polarity; });
    appearance_.push_back(best);
    sizes_of_views.push_back(size_range(all));
  }
  if (const auto contradiction = size_contradiction(sizes_of_views, given_->diameter_mm))
    warnings_.push_back(*contradiction);
}

void Tracker::warn_of_unseen() {
  for (std::size_t m = 0; m < markers_.size(); ++m)
    if (std::ranges::none_of(first_.of[m], [](const auto& image) { return image.has_value(); }))
      warnings_.push_back(
          {Reason::target_not_found,
           fmt::format("frame {}: \"{}\" is found in no image{}", first_.frame, given_->markers[m],
                       body_of_[m]
                           ? ": its place is that of its picks, moved with its body, until two views "
                             "show it; pick it again if it is visible, or begin where it is"
                           : ": it is followed from where two views show it at its picks' place; pick "
                             "it again if it is visible, or begin where it is"),
           {},
           {{"frame", double(first_.frame)}}});
}

void Tracker::find_first(int frame, const std::vector<xray::XrayImage>& images) {
  constexpr double click_sigma_px = 1.5, click_px = 6;
  // Places by the clicks alone: depth and size.
  std::vector<Eigen::Vector3d> placed;
  for (std::size_t m = 0; m < markers_.size(); ++m) {
    std::vector<Sight> clicks;
    for (const MarkerPick& pick : given_->picks)
      if (pick.marker == m)
        clicks.push_back({&cameras_[pick.view], rectified(pick.view, pick.uv_raw), click_sigma_px});
    const auto met = clicks.size() >= 2 ? sighted_point(clicks) : std::nullopt;
    if (!met) continue;
    markers_[m].place = met->place;
    placed.push_back(met->place);
  }
  if (placed.empty())
    throw BadInput(Reason::not_seen, "picks: no marker is picked in two views of the first frame");
  for (std::size_t m = 0; m < markers_.size(); ++m)
    if (markers_[m].place.isZero()) markers_[m].place = geometry::mean_of(placed);
  learn_appearance(images);

  for (const MarkerPick& pick : given_->picks) {
    const auto& pixels = images[pick.view].pixels;
    if (pick.uv_raw.minCoeff() < -0.5 || pick.uv_raw.x() > pixels.width() - 0.5 ||
        pick.uv_raw.y() > pixels.height() - 0.5)
      throw BadInput(
          Reason::bad_value,
          fmt::format("picks: \"{}\" in {} is at {:.1f}, {:.1f}, outside the image of {} x {} pixels",
                      given_->markers[pick.marker], given_->views[pick.view].images.name, pick.uv_raw.x(),
                      pick.uv_raw.y(), pixels.width(), pixels.height()));
  }
  first_.frame = frame;
  first_.of.assign(markers_.size(), std::vector<std::optional<MarkerImage>>(cameras_.size()));
  struct Snap {
    double distance;
    const MarkerPick* pick;
    MarkerImage image;
  };
  std::vector<Snap> snaps;
  for (const MarkerPick& pick : given_->picks) {
    const double radius = radius_px(pick.view, markers_[pick.marker].place), reach = click_px + radius;
    const SearchWindow window{pick.uv_raw, reach + radius, radius, 0};
    const auto nearest = picked_marker(images[pick.view], pick.uv_raw, radius, reach, appearance_[pick.view]);
    std::vector<MarkerImage> found = find_markers(images[pick.view], {&window, 1}, appearance_[pick.view]);
    // Weak discs are texture, where a clear one is near.
    for (const MarkerImage& image : found)
      if (const double distance = (image.uv_raw - pick.uv_raw).norm();
          distance < reach && has_marker_size(image, radius) && nearest && image.sigma_px < 0.15 * radius &&
          std::abs(image.contrast) > 0.5 * std::abs(nearest->image.contrast))
        snaps.push_back({distance, &pick, image});
  }
  std::ranges::stable_sort(snaps, std::less<>(), &Snap::distance);
  const auto taken = [&](const Snap& snap) {
    return std::ranges::any_of(first_.of, [&](const auto& of) {
      const auto& image = of[snap.pick->view];
      return image && (image->uv_raw - snap.image.uv_raw).norm() < 0.8;
    });
  };
  for (const Snap& snap : snaps) {
    auto& of = first_.of[snap.pick->marker][snap.pick->view];
    if (!of && !taken(snap)) of = snap.image;
  }
  for (const MarkerPick& pick : given_->picks)
    if (!first_.of[pick.marker][pick.view])
      warnings_.push_back(
          {Reason::target_not_found,
           fmt::format("frame {}: no marker of {:.1f} px in diameter within {:.0f} px of the pick \"{}\" at "
                       "{:.1f}, {:.1f}: it counts as hidden in this view; pick it again if it is visible",
                       frame, 2 * radius_px(pick.view, markers_[pick.marker].place), click_px + 2,
                       given_->markers[pick.marker], pick.uv_raw.x(), pick.uv_raw.y()),
           given_->views[pick.view].images.name,
           {{"u_px", pick.uv_raw.x()}, {"v_px", pick.uv_raw.y()}}});
  bool is_any = false;
  for (std::size_t m = 0; m < markers_.size(); ++m) {
    const auto seen = sights_of(m, first_, markers_[m].place, Eigen::Vector3d::Zero());
    is_any = is_any || seen.size() >= 2;
    if (seen.size() < 2) markers_[m].known = std::ranges::count(given_->picks, m, &MarkerPick::marker) >= 2;
  }
  if (!is_any)
    throw BadInput(
        Reason::not_seen,
        fmt::format("frame {}: no marker is found at its picks in two views: check the picks, which "
                    "are raw pixels, and \"diameter_mm\"",
                    frame));
}

}  // namespace helicarm::track
