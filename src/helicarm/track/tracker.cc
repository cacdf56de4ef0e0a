// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/tracker.h"

#include <cmath>

#include "helicarm/geometry/triangulation.h"
#include "helicarm/track/view_map.h"

namespace helicarm::track {
namespace {

constexpr double delay_spread = 0.3;  // standard deviation of the cameras' delay beforehand, frames

}  // namespace

Tracker::Snapshot Tracker::snapshot(const FrameSights& sights) const {
  constexpr double lost_mm = 5;
  Snapshot now;
  for (std::size_t m = 0; m < markers_.size(); ++m) {
    TrackedMarker& marker = now.markers.emplace_back();
    const MarkerState& state = markers_[m];
    for (std::size_t k = 0; k < cameras_.size(); ++k)
      if (sights.of[m][k]) marker.views.push_back(k);
    const auto seen = sights_of(m, sights, state.place, state.velocity);
    const auto met = seen.size() >= 2 ? sighted_point(seen) : std::nullopt;
    const double sigma = state.acceleration_mm * (1 + state.hidden);
    if (met) {
      marker.status = MarkerStatus::tracked;
      marker.place = FramePlace{met->place, met->covariance};
      marker.ray_gap_mm = met->ray_gap_mm;
    } else if (state.known && sigma < lost_mm) {
      marker.status = seen.empty() ? MarkerStatus::predicted : MarkerStatus::one_view;
      marker.place = FramePlace{state.place, sigma * sigma * Eigen::Matrix3d::Identity()};
    }
  }
  for (const BodyState& state : bodies_) {
    TrackedBody& body = now.bodies.emplace_back();
    body.reason = Reason::marker_lost;
    body.markers = state.determining;
    if (const auto lacking = too_many_repeated(sights.repeated, cameras_.size())) {
      body.reason = lacking->reason();
      continue;
    }
    if (state.poses == 0 || state.determining < 3) continue;
    body.decision = PoseDecision::accept;
    body.reason = std::nullopt;
    body.centre = state.centre;
    body.pose = FramePose{state.pose * state.first.inverse(), state.covariance};
  }
  return now;
}

Expected<Tracker> Tracker::begin(const TrackCase& the_case, int frame,
                                 const std::vector<xray::XrayImage>& images) {
  return guarded([&] {
    check_picks_in_maps(the_case, frame);
    Tracker tracker(the_case);
    for (const TrackView& view : the_case.views) tracker.cameras_.push_back(view.camera);
    tracker.markers_.resize(the_case.markers.size());
    for (MarkerState& marker : tracker.markers_) {
      marker.contrast.assign(the_case.views.size(), 0);
      marker.age.assign(the_case.views.size(), 0);
      marker.ratio.assign(the_case.views.size(), 1);
    }
    tracker.contrasts_.resize(the_case.views.size());
    tracker.delays_.assign(the_case.views.size(), {1 / (delay_spread * delay_spread), 0});
    tracker.body_of_.resize(the_case.markers.size());
    for (std::size_t b = 0; b < the_case.bodies.size(); ++b) {
      for (const std::size_t marker : the_case.bodies[b].markers) tracker.body_of_[marker] = b;
      BodyState& body = tracker.bodies_.emplace_back();
      body.in_body.assign(the_case.bodies[b].markers.size(), Eigen::Vector3d::Zero());
      body.seen.assign(the_case.bodies[b].markers.size(), 0);
    }
    tracker.find_first(frame, images);
    tracker.check_rays();
    tracker.check_geometry();
    tracker.seek_first(images);
    tracker.warn_of_unseen();
    tracker.absorb(tracker.first_);
    return tracker;
  });
}

}  // namespace helicarm::track
