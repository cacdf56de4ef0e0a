// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "helicarm/core/parallel.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/marker_fit.h"
#include "helicarm/track/tracker.h"
#include "helicarm/track/view_map.h"

namespace helicarm::track {
namespace {

/// Logarithm of the likelihood ratio that makes a marker certain.
double enough_evidence() {
  constexpr double before = 0.95, after = 0.99;  // the image is seen
  return std::log(after / (1 - after)) - std::log(before / (1 - before));
}

}  // namespace

ContrastModel Tracker::contrast_of(std::size_t marker, std::size_t view) const {
  ContrastModel model = contrasts_[view].model();
  model.at_zero *= markers_[marker].ratio[view];
  model.share *= markers_[marker].ratio[view];
  return model;
}

/// By the images that show it already.
std::optional<ExpectedMarker> Tracker::narrowed(const ExpectedMarker& marker, std::size_t index,
                                                const FrameSights& sights) const {
  if (!marker.place.allFinite()) return std::nullopt;
  ExpectedMarker made = marker;
  const auto seen = sights_of(index, sights, marker.place, velocity_of(index));
  const FramePlace place = with_sights({marker.place, marker.covariance}, seen);
  made.place = place.place;
  made.covariance = place.covariance;
  return made;
}

/// Fits each disc again as that of a marker of known size and contrast, beside its neighbours, and looks for
/// markers without a disc where they are expected. What background alone explains as well is none.
void Tracker::seek_evidence(FrameSights& sights, const std::vector<ExpectedMarker>& expected,
                            const std::vector<xray::XrayImage>& images) const {
  constexpr double widest_px = 2, nearest_px = 1.2;
  const double enough = enough_evidence();
  const std::size_t count = markers_.size();
  for (const bool is_search : {false, true}) {
    std::vector<std::optional<ExpectedMarker>> at(count);
    for (std::size_t m = 0; m < count; ++m) at[m] = narrowed(expected[m], m, sights);
    const FrameSights before = sights;
    parallel_for(cameras_.size(), 0, [&](std::size_t k) {
      if (images[k].pixels.empty()) return;
      struct Where {
        Eigen::Vector2d uv;
        Eigen::Matrix2d covariance;
      };
      std::vector<std::optional<Where>> where(count);
      for (std::size_t m = 0; m < count; ++m) {
        if (const auto& image = before.of[m][k]) {
          where[m] = Where{image->uv_raw, Eigen::Matrix2d::Zero()};
          continue;
        }
        if (!at[m] || !(cameras_[k].depth(at[m]->place) > 1)) continue;
        const auto slope = geometry::projection_jacobian(cameras_[k], at[m]->place);
        Eigen::Matrix2d spread = slope * at[m]->covariance * slope.transpose();
        spread.diagonal().array() += std::pow(at[m]->images[k].shift_sigma, 2) + 0.01;
        const auto uv =
            raw_in(given_->views[k], cameras_[k].project(at[m]->place) + at[m]->images[k].shift_px);
        if (uv && uv->allFinite() && std::sqrt(spread.trace() / 2) < widest_px) where[m] = Where{*uv, spread};
      }
      for (std::size_t m = 0; m < count; ++m) {
        auto& image = sights.of[m][k];
        if (!where[m] || image.has_value() == is_search) continue;
        const auto radius_of = [&](std::size_t i) {
          const Eigen::Vector3d& place = at[i] ? at[i]->place : markers_[i].place;
          return appearance_[k].radius_factor * radius_px(k, place);
        };
        std::vector<KnownNeighbour> others;
        for (std::size_t i = 0; i < count; ++i)
          if (i != m && where[i]) others.push_back({where[i]->uv, radius_of(i)});
        const KnownMarker known{where[m]->uv, where[m]->covariance, radius_of(m), contrast_of(m, k)};
        const auto fit = fit_known_marker(images[k].pixels, known, others, appearance_[k]);
        if (!fit || !is_in_map(k, fit->image)) continue;
        if (!is_search) {
          image = fit->image;
          continue;
        }
        if (fit->evidence < enough) continue;
        bool is_taken = false;
        for (std::size_t i = 0; i < count; ++i)
          is_taken = is_taken ||
                     (sights.of[i][k] && (sights.of[i][k]->uv_raw - fit->image.uv_raw).norm() < nearest_px);
        if (!is_taken) image = fit->image;
      }
    });
  }
}

/// Whether background explains the disc near a pick as well: it is one of many places within reach.
bool Tracker::may_be_noise(const MarkerImage& image, const MarkerPick& pick, const FrameSights& sights,
                           const xray::XrayImage& of) const {
  const double radius = radius_px(pick.view, markers_[pick.marker].place), reach = pick_reach_px + radius;
  std::vector<KnownNeighbour> others;
  for (std::size_t i = 0; i < markers_.size(); ++i)
    if (const auto& other = sights.of[i][pick.view]; other && i != pick.marker)
      others.push_back({other->uv_raw, other->radius_px});
  const KnownMarker known{image.uv_raw, Eigen::Matrix2d::Zero(),
                          appearance_[pick.view].radius_factor * radius, contrast_of(pick.marker, pick.view)};
  const auto fit = fit_known_marker(of.pixels, known, others, appearance_[pick.view]);
  if (!fit) return false;
  const double one_of_many = std::log(2 * std::pow(fit->image.sigma_px / reach, 2));
  return fit->evidence + std::min(0.0, one_of_many) < enough_evidence();
}

std::vector<MarkerPick> Tracker::drop_weak_first(const std::vector<xray::XrayImage>& images) {
  std::vector<MarkerPick> dropped;
  for (const MarkerPick& pick : given_->picks) {
    const auto& image = first_.of[pick.marker][pick.view];
    if (!image || !may_be_noise(*image, pick, first_, images[pick.view])) continue;
    dropped.push_back(pick);
    if (std::ranges::count(given_->picks, pick.marker, &MarkerPick::marker) >= 2)
      markers_[pick.marker].known = true;
  }
  for (const MarkerPick& pick : dropped) first_.of[pick.marker][pick.view].reset();
  return dropped;
}

/// Likewise in the first frame, where the picks place the markers.
void Tracker::seek_first(const std::vector<xray::XrayImage>& images) {
  constexpr double click_px = 2;
  for (std::size_t k = 0; k < cameras_.size(); ++k)
    for (const auto& of : first_.of)
      if (of[k]) contrasts_[k].add(*of[k], 1);
  const auto dropped = drop_weak_first(images);
  std::vector<ExpectedMarker> expected;
  for (std::size_t m = 0; m < markers_.size(); ++m) {
    ExpectedMarker& made = expected.emplace_back();
    made.place = markers_[m].place;
    double sigma_mm = 0;
    for (const geometry::View& camera : cameras_)
      sigma_mm = std::max(sigma_mm, click_px * camera.depth(made.place) / std::abs(camera.intrinsics.fy));
    made.covariance *= sigma_mm * sigma_mm;
    expect_images(made, m, Eigen::Vector3d::Zero());
    // One that is picked in one view has no place yet.
    if (std::ranges::count(given_->picks, m, &MarkerPick::marker) < 2)
      made.place.setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  seek_evidence(first_, expected, images);
  for (const MarkerPick& pick : dropped)
    if (!first_.of[pick.marker][pick.view])
      warnings_.push_back(
          {Reason::target_not_found,
           fmt::format(
               "frame {}: the disc nearest to the pick \"{}\" at {:.1f}, {:.1f} may be noise as well: "
               "the marker counts as hidden in this view until it is clear",
               first_.frame, given_->markers[pick.marker], pick.uv_raw.x(), pick.uv_raw.y()),
           given_->views[pick.view].images.name,
           {{"u_px", pick.uv_raw.x()}, {"v_px", pick.uv_raw.y()}}});
  contrasts_.assign(cameras_.size(), {});
}

}  // namespace helicarm::track
