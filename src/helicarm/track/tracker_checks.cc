// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "helicarm/geometry/ray.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/exchanged_views.h"
#include "helicarm/track/tracker.h"

namespace helicarm::track {

/// Of all markers of the first frame at once: exchanged cameras need not leave large gaps.
void Tracker::check_cameras() const {
  ViewPoints points;
  for (const auto& of : first_.of)
    for (const auto& image : of) points.push_back(image ? std::optional(image->uv_raw) : std::nullopt);
  if (const auto exchanged = exchanged_views(given_->views, {points}))
    throw BadInput({Reason::residual_too_large,
                    fmt::format("frame {}: {}: they have each other's images, or cameras: correct the case",
                                first_.frame, exchanged_text(given_->views, *exchanged)),
                    {},
                    {{"gap_mm", exchanged->gap_mm}, {"exchanged_mm", exchanged->exchanged_mm}}});
}

void Tracker::check_rays() {
  check_cameras();
  constexpr double largest_gap_mm = 1, largest_gap_px = 4;
  const auto gap_of = [&](std::size_t first, std::size_t second, std::size_t k) -> std::optional<double> {
    const auto &a = first_.of[first][0], &b = first_.of[second][k];
    if (!a || !b) return std::nullopt;
    return geometry::gap_between(geometry::ray_through(cameras_[0], rectified(0, a->uv_raw)),
                                 geometry::ray_through(cameras_[k], rectified(k, b->uv_raw)));
  };
  for (std::size_t k = 1; k < cameras_.size(); ++k)
    for (std::size_t m = 0; m < markers_.size(); ++m) {
      const auto gap = gap_of(m, m, k);
      const double mm_per_px = cameras_[k].depth(markers_[m].place) / std::abs(cameras_[k].intrinsics.fy);
      if (!gap || *gap < std::max(largest_gap_mm, largest_gap_px * mm_per_px)) continue;
      for (std::size_t other = 0; other < markers_.size(); ++other) {
        const auto here = gap_of(m, other, k), there = gap_of(other, m, k), its = gap_of(other, other, k);
        if (other == m || !here || !there || !its) continue;
        if (*here + *there < 0.2 * (*gap + *its))
          throw BadInput(
              {Reason::markers_swapped,
               fmt::format("frame {}: the picks of \"{}\" and \"{}\" are exchanged in {} or in {}: "
                           "their rays miss each other by {:.2f} and {:.2f} mm, exchanged by {:.2f} "
                           "and {:.2f} mm: correct the names",
                           first_.frame, given_->markers[m], given_->markers[other],
                           given_->views[k].images.name, given_->views[0].images.name, *gap, *its, *here,
                           *there),
               given_->views[k].images.name,
               {{"gap_mm", *gap}, {"exchanged_mm", *here}}});
      }
      // Clicks whose rays meet are right: a disc beside one of them is not the marker's.
      const auto click_in = [&](std::size_t view) {
        return std::ranges::find_if(
            given_->picks, [&](const MarkerPick& pick) { return pick.marker == m && pick.view == view; });
      };
      const auto a = click_in(0), b = click_in(k);
      if (geometry::gap_between(geometry::ray_through(cameras_[0], rectified(0, a->uv_raw)),
                                geometry::ray_through(cameras_[k], rectified(k, b->uv_raw))) <
          std::max(largest_gap_mm, largest_gap_px * mm_per_px)) {
        const bool is_first =
            (first_.of[m][0]->uv_raw - a->uv_raw).norm() > (first_.of[m][k]->uv_raw - b->uv_raw).norm();
        const std::size_t view = is_first ? 0 : k;
        first_.of[m][view].reset();
        markers_[m].known = true;
        warnings_.push_back(
            {Reason::target_not_found,
             fmt::format("frame {}: the disc nearest to the pick \"{}\" contradicts the other view "
                         "by {:.2f} mm: the marker counts as hidden in this view",
                         first_.frame, given_->markers[m], *gap),
             given_->views[view].images.name,
             {{"gap_mm", *gap}}});
        continue;
      }
      throw BadInput({Reason::residual_too_large,
                      fmt::format("frame {}: the rays of \"{}\" in {} and {} miss each other by {:.2f} mm: a "
                                  "pick is on another marker, or the cameras are of another set-up",
                                  first_.frame, given_->markers[m], given_->views[0].images.name,
                                  given_->views[k].images.name, *gap),
                      given_->views[k].images.name,
                      {{"gap_mm", *gap}}});
    }
}

void Tracker::check_geometry() const {
  constexpr double most_mm = 0.5;  // rms, of markers about the geometry given
  std::vector<std::vector<Eigen::Vector3d>> places(given_->bodies.size());
  std::vector<std::vector<std::size_t>> indices(given_->bodies.size());
  const auto rms_of = [](const std::vector<Eigen::Vector3d>& known,
                         const std::vector<Eigen::Vector3d>& seen) {
    const geometry::RigidTransform pose = geometry::absolute_pose(known, seen);
    double squares = 0;
    for (std::size_t i = 0; i < known.size(); ++i) squares += (pose * known[i] - seen[i]).squaredNorm();
    return std::sqrt(squares / double(known.size()));
  };
  for (std::size_t b = 0; b < given_->bodies.size(); ++b)
    for (std::size_t i = 0; i < given_->bodies[b].markers.size(); ++i) {
      const std::size_t m = given_->bodies[b].markers[i];
      const auto met = sighted_point(sights_of(m, first_, markers_[m].place, Eigen::Vector3d::Zero()));
      if (!met) continue;
      places[b].push_back(met->place);
      indices[b].push_back(i);
    }
  const auto chosen = [](const std::vector<Eigen::Vector3d>& from, const std::vector<std::size_t>& at) {
    std::vector<Eigen::Vector3d> points;
    for (const std::size_t i : at) points.push_back(from[i]);
    return points;
  };
  for (std::size_t b = 0; b < given_->bodies.size(); ++b) {
    const BodyPlan& body = given_->bodies[b];
    if (body.geometry.empty() || places[b].size() < 3) continue;
    const auto known = chosen(body.geometry, indices[b]);
    const double rms = rms_of(known, places[b]);
    if (rms < most_mm) continue;
    for (std::size_t i = 0; i < known.size(); ++i)
      for (std::size_t k = i + 1; k < known.size(); ++k) {
        auto exchanged = places[b];
        std::swap(exchanged[i], exchanged[k]);
        const double there = rms_of(known, exchanged);
        if (there < most_mm && there < 0.3 * rms)
          throw BadInput(
              {Reason::markers_swapped,
               fmt::format("frame {}: \"{}\" and \"{}\" of the body \"{}\" are exchanged against its "
                           "geometry: {:.2f} mm rms, exchanged {:.2f} mm: correct the names",
                           first_.frame, given_->markers[body.markers[indices[b][i]]],
                           given_->markers[body.markers[indices[b][k]]], body.name, rms, there),
               {},
               {{"rms_mm", rms}, {"exchanged_mm", there}}});
      }
    for (std::size_t other = 0; other < given_->bodies.size(); ++other) {
      if (other == b || places[other].size() != body.geometry.size() || indices[other].size() != known.size())
        continue;
      const double there = rms_of(known, places[other]);
      if (there < most_mm && there < 0.3 * rms)
        throw BadInput(
            {Reason::bodies_exchanged,
             fmt::format("frame {}: the geometry of the body \"{}\" is that of the markers of \"{}\": "
                         "{:.2f} mm rms against {:.2f} mm: the bodies are exchanged",
                         first_.frame, body.name, given_->bodies[other].name, there, rms),
             {},
             {{"rms_mm", rms}, {"exchanged_mm", there}}});
    }
    throw BadInput(
        {Reason::residual_too_large,
         fmt::format("frame {}: the markers of the body \"{}\" differ from its geometry by {:.2f} mm "
                     "rms, limit {:g} mm: it is of another body, in another unit, or has other names",
                     first_.frame, body.name, rms, most_mm),
         {},
         {{"rms_mm", rms}, {"limit_mm", most_mm}}});
  }
}

}  // namespace helicarm::track
