// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/exchanged_views.h"

#include <algorithm>
#include <numeric>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/ray.h"
#include "helicarm/track/view_map.h"

namespace helicarm::track {
namespace {

/// [marker], of all frames and further views.
std::vector<std::vector<double>> gaps_mm(const std::vector<TrackView>& views,
                                         const std::vector<ViewPoints>& frames,
                                         const std::vector<std::size_t>& camera_of) {
  std::vector<std::vector<double>> gaps(frames.empty() ? 0 : frames.front().size() / views.size());
  const auto ray = [&](std::size_t view, const Eigen::Vector2d& raw) -> std::optional<geometry::Ray> {
    const TrackView& camera = views[camera_of[view]];
    const auto uv = rectified_in(camera, raw);
    return uv ? std::optional(geometry::ray_through(camera.camera, *uv)) : std::nullopt;
  };
  for (const ViewPoints& frame : frames)
    for (std::size_t m = 0; m < gaps.size(); ++m)
      for (std::size_t k = 1; k < views.size(); ++k) {
        const auto &first = frame[m * views.size()], &other = frame[m * views.size() + k];
        if (!first || !other) continue;
        const auto from = ray(0, *first), to = ray(k, *other);
        if (from && to) gaps[m].push_back(geometry::gap_between(*from, *to));
      }
  return gaps;
}

/// Of each marker that two views show.
std::vector<double> usual_gaps_mm(const std::vector<TrackView>& views, const std::vector<ViewPoints>& frames,
                                  const std::vector<std::size_t>& camera_of) {
  std::vector<double> usual;
  for (auto& of_marker : gaps_mm(views, frames, camera_of))
    if (!of_marker.empty()) usual.push_back(median(std::move(of_marker)));
  return usual;
}

std::vector<std::size_t> own_cameras(std::size_t views) {
  std::vector<std::size_t> cameras(views);
  std::iota(cameras.begin(), cameras.end(), std::size_t(0));
  return cameras;
}

}  // namespace

std::optional<double> median_gap_mm(const std::vector<TrackView>& views,
                                    const std::vector<ViewPoints>& frames) {
  std::vector<double> gaps;
  for (const auto& of_marker : gaps_mm(views, frames, own_cameras(views.size())))
    gaps.insert(gaps.end(), of_marker.begin(), of_marker.end());
  if (gaps.empty()) return std::nullopt;
  return median(std::move(gaps));
}

std::optional<ExchangedViews> exchanged_views(const std::vector<TrackView>& views,
                                              const std::vector<ViewPoints>& frames) {
  constexpr std::size_t fewest = 4;
  constexpr double least_mm = 0.05, far_better = 0.2;
  const std::vector<double> own = usual_gaps_mm(views, frames, own_cameras(views.size()));
  if (own.size() < fewest) return std::nullopt;
  const double gap = median(own);
  std::optional<ExchangedViews> best;
  for (std::size_t i = 0; i < views.size(); ++i)
    for (std::size_t k = i + 1; k < views.size(); ++k) {
      auto cameras = own_cameras(views.size());
      std::swap(cameras[i], cameras[k]);
      const std::vector<double> gaps = usual_gaps_mm(views, frames, cameras);
      if (gaps.size() < own.size()) continue;
      const double exchanged = median(gaps);
      if (gap > least_mm && exchanged < (best ? best->exchanged_mm : far_better * gap))
        best = ExchangedViews{i, k, gap, exchanged};
    }
  return best;
}

std::string exchanged_text(const std::vector<TrackView>& views, const ExchangedViews& exchanged) {
  return fmt::format("the rays miss each other by {:.2g} mm (median), by {:.2g} mm with {} and {} exchanged",
                     exchanged.gap_mm, exchanged.exchanged_mm, views[exchanged.first].images.name,
                     views[exchanged.second].images.name);
}

}  // namespace helicarm::track
