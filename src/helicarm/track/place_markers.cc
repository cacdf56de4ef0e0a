// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/place_markers.h"

#include <algorithm>
#include <cmath>

#include "helicarm/geometry/small_matrix.h"
#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/camera_errors.h"

namespace helicarm::track {
namespace {

constexpr double lost_mm = 5;  // a place that is less certain is none

double largest_sigma(const Eigen::Matrix3d& covariance) {
  return std::sqrt(geometry::symmetric_eigen(covariance).values[2]);
}

/// Covariance by the cameras' own, common to all frames.
Eigen::Matrix3d by_cameras(const SequenceData& work, const Eigen::Vector3d& place) {
  const Eigen::Matrix3Xd by = place_by_cameras(work, place);
  if (by.cols() == 0) return Eigen::Matrix3d::Zero();
  return by * work.the_case.camera_covariance * by.transpose();
}

/// A marker's places by its own images alone, smoothed between the first and the last frame in which two
/// views show it; nothing where too few frames do so to know how it moves.
std::vector<std::optional<FramePlace>> smoothed_alone(const SequenceData& work, std::size_t m) {
  constexpr int fewest = 8;
  std::vector<std::optional<FramePlace>> measured, made(work.frames);
  int count = 0;
  std::size_t first = work.frames, last = 0;
  for (std::size_t f = 0; f < work.frames; ++f) {
    auto& at = measured.emplace_back();
    if (const auto& met = work.points[f][m]) {
      at = FramePlace{met->place, met->covariance};
      ++count;
      first = std::min(first, f);
      last = f;
    }
  }
  if (count < fewest) return made;
  const auto smooth = smooth_places(work.times, measured);
  for (std::size_t f = first; smooth && f <= last; ++f) made[f] = (*smooth)[f];
  return made;
}

/// Whether the images are of something else than the marker that its body places there.
bool contradicts(const SightedPoint& point, const FramePlace& by_body) {
  constexpr double farthest_mm = 0.5, farthest_chi2 = 60;
  const Eigen::Vector3d off = point.place - by_body.place;
  const Eigen::Matrix3d spread = point.covariance + by_body.covariance;
  return off.norm() > farthest_mm && geometry::squared_distance(off, spread) > farthest_chi2;
}

/// Likewise for one image.
bool contradicts(const Sight& sight, const FramePlace& by_body) {
  constexpr double farthest_chi2 = 30;
  if (!(sight.view->depth(by_body.place) > 1)) return true;
  const auto slope = geometry::projection_jacobian(*sight.view, by_body.place);
  Eigen::Matrix2d spread = slope * by_body.covariance * slope.transpose();
  spread.diagonal().array() += sight.sigma_px * sight.sigma_px;
  const Eigen::Vector2d off = sight.uv - sight.view->project(by_body.place);
  return geometry::squared_distance(off, spread) > farthest_chi2;
}

/// A marker and the body that holds it.
struct Held {
  const SequenceData& work;
  const BodyPlan& plan;
  const Estimated& at;
  const BodySequence& body;
  std::size_t index;  // in the body

  std::optional<FramePlace> place(std::size_t f, bool by_others) const {
    return place_by_body(work, plan, at, body, index, f, by_others);
  }
  const std::optional<SightedPoint>& point(std::size_t f) const {
    return work.points[f][plan.markers[index]];
  }
};

std::optional<Held> held(const SequenceData& work, const std::vector<Estimated>& bodies,
                         const Sequence& sequence, std::size_t m) {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const BodyPlan& plan = work.the_case.bodies[b];
    const auto found = std::ranges::find(plan.markers, m);
    if (found != plan.markers.end())
      return Held{work, plan, bodies[b], sequence.bodies[b], std::size_t(found - plan.markers.begin())};
  }
  return std::nullopt;
}

/// Whether nothing but its own images says that this is the marker: its body has moved unseen for too long,
/// and no other of its markers is at the right distance.
bool is_unsupported(const Held& marker, std::size_t f, const FramePlace& by_motion) {
  constexpr double rigid_mm = 1;
  if (largest_sigma(by_motion.covariance) < lost_mm) return false;
  const auto& in_body = marker.at.shape.in_body;
  const std::size_t i = marker.index;
  for (std::size_t k = 0; k < in_body.size(); ++k) {
    const auto& other = marker.work.points[f][marker.plan.markers[k]];
    if (k == i || !other || !in_body[k] || !in_body[i]) continue;
    const double distance = (other->place - marker.point(f)->place).norm(),
                 known = (*in_body[k] - *in_body[i]).norm();
    if (std::abs(distance - known) < rigid_mm) return false;
  }
  return true;
}

/// Whether two views show something else than the marker, by the others of its body in this frame, else by
/// the body's motion.
bool is_of_another(const Held& marker, std::size_t f, const std::optional<FramePlace>& by_others) {
  if (by_others) return contradicts(*marker.point(f), *by_others);
  const auto by_motion = marker.place(f, false);
  return by_motion && (contradicts(*marker.point(f), *by_motion) || is_unsupported(marker, f, *by_motion));
}

/// A marker in every frame: by two views, else by its body or its own smooth motion and what one view shows.
void place_marker(const SequenceData& work, const std::vector<Estimated>& bodies, std::size_t m,
                  Sequence& sequence) {
  const auto holder = held(work, bodies, sequence, m);
  std::vector<std::optional<FramePlace>> alone;
  std::optional<Eigen::Matrix3d> of_cameras;
  for (std::size_t f = 0; f < work.frames; ++f) {
    TrackedMarker& marker = sequence.markers[f][m];
    auto seen = work.seen(f, m);
    const auto& point = work.points[f][m];
    const auto by_others = point && holder ? holder->place(f, true) : std::nullopt;
    const bool is_wrong = point && holder && is_of_another(*holder, f, by_others);
    if (is_wrong) seen.clear();
    if (point && !is_wrong) {
      marker.status = MarkerStatus::tracked;
      marker.ray_gap_mm = point->ray_gap_mm;
      // What weak images leave open the others of the body say.
      marker.place = by_others ? with_sights(*by_others, seen) : FramePlace{point->place, point->covariance};
    } else {
      auto guess = holder ? holder->place(f, false) : std::nullopt;
      if (!guess) {
        if (alone.empty()) alone = smoothed_alone(work, m);
        guess = alone[f];
      }
      if (guess && seen.size() == 1 && contradicts(seen.front(), *guess)) seen.clear();
      if (guess) {
        const FramePlace place = with_sights(*guess, seen);
        if (largest_sigma(place.covariance) < lost_mm) {
          marker.status = seen.empty() ? MarkerStatus::predicted : MarkerStatus::one_view;
          marker.place = place;
        }
      }
    }
    for (std::size_t k = 0; k < work.views && !seen.empty(); ++k)
      if (work.sights[f][m][k]) marker.views.push_back(k);
    if (!marker.place) continue;
    if (!of_cameras) of_cameras = by_cameras(work, marker.place->place);
    marker.place->covariance += *of_cameras;
  }
}

}  // namespace

void place_markers(const SequenceData& work, const std::vector<Estimated>& bodies, Sequence& sequence) {
  sequence.markers.assign(work.frames, std::vector<TrackedMarker>(work.markers));
  for (std::size_t m = 0; m < work.markers; ++m) place_marker(work, bodies, m, sequence);
}

}  // namespace helicarm::track
