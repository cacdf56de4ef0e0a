// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/first_appearance.h"
#include "helicarm/track/tracker.h"

namespace helicarm::track {

void Tracker::learn_appearance(const std::vector<xray::XrayImage>& images) {
  std::vector<SizeRange> sizes(cameras_.size());
  appearance_.resize(cameras_.size());
  parallel_for(cameras_.size(), 0, [&](std::size_t k) {
    std::vector<PickedPlace> picks;
    for (const MarkerPick& pick : given_->picks)
      if (pick.view == k)
        picks.push_back({pick.marker, pick.uv_raw, radius_px(k, markers_[pick.marker].place)});
    const LearntAppearance learnt = learnt_appearance(images[k], picks, pick_reach_px);
    appearance_[k] = learnt.appearance;
    sizes[k] = learnt.sizes;
  });
  if (const auto contradiction = size_contradiction(sizes, given_->diameter_mm))
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
  constexpr double click_sigma_px = 1.5;
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
    const double radius = radius_px(pick.view, markers_[pick.marker].place), reach = pick_reach_px + radius;
    const SearchWindow window{pick.uv_raw, reach + radius, radius, 0};
    const auto nearest = picked_marker(images[pick.view], pick.uv_raw, radius, reach, appearance_[pick.view]);
    std::vector<MarkerImage> found = find_markers(images[pick.view], {&window, 1}, appearance_[pick.view]);
    // Weak discs are texture, where a clear one is near.
    for (const MarkerImage& image : found)
      if (const double distance = (image.uv_raw - pick.uv_raw).norm();
          distance < reach && is_in_map(pick.view, image) && has_marker_size(image, radius) && nearest &&
          image.sigma_px < 0.15 * radius &&
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
                       frame, 2 * radius_px(pick.view, markers_[pick.marker].place), pick_reach_px + 2,
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
                    "are raw pixels, \"diameter_mm\", and the unit (cm, mm) of the cameras",
                    frame));
}

}  // namespace helicarm::track
