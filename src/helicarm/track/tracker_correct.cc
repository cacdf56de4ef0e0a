// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "helicarm/track/tracker.h"
#include "helicarm/track/view_map.h"

namespace helicarm::track {
namespace {

/// The nearest of the discs that are not much weaker than the clearest one within reach.
std::optional<MarkerImage> disc_at(const xray::XrayImage& image, const TrackView& view,
                                   const MarkerAppearance& appearance, const Eigen::Vector2d& at,
                                   double radius) {
  constexpr double clear = 0.5;
  const double reach = pick_reach_px + radius;
  const SearchWindow window{at, reach + radius, radius, 0};
  std::vector<MarkerImage> discs = find_markers(image, {&window, 1}, appearance);
  std::erase_if(discs, [&](const MarkerImage& disc) {
    return (disc.uv_raw - at).norm() > reach || !has_marker_size(disc, radius) ||
           !rectified_in(view, disc.uv_raw);
  });
  double strongest = 0;
  for (const MarkerImage& disc : discs) strongest = std::max(strongest, std::abs(disc.contrast));
  std::erase_if(discs, [&](const MarkerImage& disc) { return std::abs(disc.contrast) < clear * strongest; });
  const auto nearest = std::ranges::min_element(
      discs, std::less<>(), [&](const MarkerImage& disc) { return (disc.uv_raw - at).norm(); });
  return nearest == discs.end() ? std::nullopt : std::optional(*nearest);
}

}  // namespace

bool Tracker::is_corrected(std::size_t marker, int frame) const {
  return std::ranges::any_of(given_->corrections, [&](const MarkerPick& pick) {
    return pick.marker == marker && pick.frame == frame;
  });
}

/// A disc serves one marker: the corrected one.
void Tracker::correct(FrameSights& sights, const std::vector<xray::XrayImage>& images) const {
  constexpr double same_px = 0.8;
  for (const MarkerPick& pick : given_->corrections) {
    if (pick.frame != sights.frame) continue;
    const std::size_t k = pick.view;
    if (images[k].pixels.empty()) continue;
    auto& image = sights.of[pick.marker][k];
    image = disc_at(images[k], given_->views[k], appearance_[k], pick.uv_raw,
                    radius_px(k, markers_[pick.marker].place));
    if (image && may_be_noise(*image, pick, sights, images[k])) image.reset();
  }
  for (const MarkerPick& pick : given_->corrections) {
    const auto& image = sights.of[pick.marker][pick.view];
    if (pick.frame != sights.frame || !image) continue;
    for (std::size_t m = 0; m < markers_.size(); ++m) {
      auto& other = sights.of[m][pick.view];
      const bool is_own = std::ranges::any_of(given_->corrections, [&](const MarkerPick& one) {
        return one.marker == m && one.view == pick.view && one.frame == pick.frame;
      });
      if (m != pick.marker && !is_own && other && (other->uv_raw - image->uv_raw).norm() < same_px)
        other.reset();
    }
  }
}

}  // namespace helicarm::track
