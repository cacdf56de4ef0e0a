// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "helicarm/core/parallel.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/tracker.h"
#include "helicarm/track/view_map.h"

namespace helicarm::track {
namespace {

double window_reach(double sigma_px) { return std::clamp(4 * sigma_px + 2, 4.0, 45.0); }

}  // namespace

std::vector<std::vector<Candidate>> Tracker::search(const std::vector<xray::XrayImage>& images,
                                                    const std::vector<ExpectedMarker>& markers,
                                                    std::optional<double> reach_px) const {
  std::vector<std::vector<Candidate>> discs(cameras_.size());
  parallel_for(cameras_.size(), 0, [&](std::size_t k) {
    if (images[k].pixels.empty()) return;
    std::vector<SearchWindow> windows;
    for (const ExpectedMarker& marker : markers) {
      if (!(cameras_[k].depth(marker.place) > 1)) continue;
      const auto slope = geometry::projection_jacobian(cameras_[k], marker.place);
      const Eigen::Matrix2d spread = slope * marker.covariance * slope.transpose();
      const double sigma = std::sqrt(spread.trace() / 2) + marker.images[k].shift_sigma;
      const auto at = raw_in(given_->views[k], cameras_[k].project(marker.place) + marker.images[k].shift_px);
      if (!at || !at->allFinite()) continue;
      windows.push_back({*at, reach_px.value_or(window_reach(sigma)), marker.images[k].radius_px,
                         marker.images[k].visible});
    }
    for (const MarkerImage& image : find_markers(images[k], windows, appearance_[k]))
      if (const auto uv = rectified_in(given_->views[k], image.uv_raw)) discs[k].push_back({image, *uv});
  });
  return discs;
}

FrameSights Tracker::look(int frame, const std::vector<xray::XrayImage>& images) const {
  FrameSights sights = look_freely(frame, images);
  correct(sights, images);
  return sights;
}

FrameSights Tracker::look_freely(int frame, const std::vector<xray::XrayImage>& images) const {
  const std::size_t count = markers_.size();
  std::vector<ExpectedMarker> markers;
  for (std::size_t m = 0; m < count; ++m) {
    const auto b = body_of_[m];
    const auto prior = b ? predicted_pose(bodies_[*b]) : std::nullopt;
    const auto i =
        b ? std::size_t(std::ranges::find(given_->bodies[*b].markers, m) - given_->bodies[*b].markers.begin())
          : 0;
    markers.push_back(prior && bodies_[*b].seen[i] > 0 ? expected(m, *prior, 1.5) : expected(m));
  }
  const auto sights_from = [&](const std::vector<std::vector<int>>& assigned,
                               const std::vector<std::vector<Candidate>>& from) {
    FrameSights sights{frame, {}, 0};
    for (std::size_t m = 0; m < count; ++m) {
      auto& of = sights.of.emplace_back(cameras_.size());
      for (std::size_t k = 0; k < cameras_.size(); ++k)
        if (assigned[m][k] != not_seen) of[k] = from[k][std::size_t(assigned[m][k])].image;
    }
    return sights;
  };
  auto discs = search(images, markers, std::nullopt);
  const auto by_motion = assign(cameras_, markers, discs);
  const FrameSights first = sights_from(by_motion, discs);

  // The bodies' poses of this frame place each marker within a few tenths of a millimetre.
  std::vector<ExpectedMarker> again = markers;
  std::vector<ExpectedMarker> unseen;
  for (std::size_t b = 0; b < bodies_.size(); ++b) {
    const auto fit = pose_of(bodies_[b], given_->bodies[b], first);
    if (!fit || fit->determining < 3) continue;
    const PosePrior pose{fit->world_from_body, fit->covariance, fit->centre};
    for (std::size_t i = 0; i < given_->bodies[b].markers.size(); ++i) {
      if (bodies_[b].seen[i] == 0) continue;
      const std::size_t m = given_->bodies[b].markers[i];
      again[m] = expected(m, pose, 1.5);
      if (std::ranges::find(by_motion[m], not_seen) != by_motion[m].end()) unseen.push_back(again[m]);
    }
  }
  constexpr double near_px = 4;
  if (!unseen.empty()) {
    const auto more = search(images, unseen, near_px);
    for (std::size_t k = 0; k < cameras_.size(); ++k)
      for (const Candidate& disc : more[k])
        if (std::ranges::none_of(discs[k], [&](const Candidate& other) {
              return (other.image.uv_raw - disc.image.uv_raw).norm() < 0.8;
            }))
          discs[k].push_back(disc);
  }
  const auto assigned = assign(cameras_, again, discs);
  FrameSights sights = sights_from(assigned, discs);
  for (std::size_t m = 0; m < count; ++m)
    for (std::size_t k = 0; k < cameras_.size(); ++k)
      if (by_motion[m][k] != not_seen && by_motion[m][k] != assigned[m][k])
        for (std::size_t other = 0; other < count; ++other)
          if (other != m && assigned[other][k] == by_motion[m][k]) ++sights.repaired;

  // A marker that has moved in its bone is where its own motion, and the rays of two views, place it.
  std::vector<std::size_t> lost;
  std::vector<ExpectedMarker> alone;
  for (std::size_t m = 0; m < count; ++m)
    if (body_of_[m] && std::ranges::find(assigned[m], not_seen) != assigned[m].end()) {
      lost.push_back(m);
      alone.push_back(expected(m));
      alone.back().covariance += 0.7 * 0.7 * Eigen::Matrix3d::Identity();
    }
  if (lost.empty()) {
    seek_evidence(sights, again, images);
    return sights;
  }
  auto left = search(images, alone, std::nullopt);
  for (std::size_t k = 0; k < cameras_.size(); ++k)
    std::erase_if(left[k], [&](const Candidate& disc) {
      for (std::size_t m = 0; m < count; ++m)
        if (const auto& image = sights.of[m][k]; image && std::ranges::find(lost, m) == lost.end() &&
                                                 (image->uv_raw - disc.image.uv_raw).norm() < 1.5)
          return true;
      return false;
    });
  const auto found = assign(cameras_, alone, left);
  for (std::size_t i = 0; i < lost.size(); ++i) {
    constexpr double most_moved_mm = 3, clear_px = 0.12, most_gap_mm = 0.15, most_off = 0.35;
    std::vector<Sight> seen;
    for (std::size_t k = 0; k < cameras_.size(); ++k)
      if (found[i][k] != not_seen) {
        const Candidate& disc = left[k][std::size_t(found[i][k])];
        if (disc.image.sigma_px < clear_px) seen.push_back({&cameras_[k], disc.uv, disc.image.sigma_px});
      }
    const auto met = seen.size() >= 2 ? sighted_point(seen) : std::nullopt;
    if (!met || (met->place - again[lost[i]].place).norm() > most_moved_mm) continue;
    // Beside a view that shows it where its body has it, another may show bone: a clear disc of its contrast.
    if (std::ranges::any_of(assigned[lost[i]], [](int disc) { return disc != not_seen; })) {
      bool is_like_it = met->ray_gap_mm < most_gap_mm;
      for (std::size_t k = 0; k < cameras_.size(); ++k) {
        if (found[i][k] == not_seen) continue;
        const double expected = alone[i].images[k].visible,
                     contrast = std::abs(left[k][std::size_t(found[i][k])].image.contrast);
        is_like_it = is_like_it && expected > 0 && std::abs(contrast / expected - 1) < most_off;
      }
      if (!is_like_it) continue;
    }
    for (std::size_t k = 0; k < cameras_.size(); ++k)
      if (found[i][k] != not_seen) sights.of[lost[i]][k] = left[k][std::size_t(found[i][k])].image;
  }
  seek_evidence(sights, again, images);
  return sights;
}

}  // namespace helicarm::track
