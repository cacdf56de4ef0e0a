// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/sequence.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <fmt/format.h>

#include "helicarm/track/body_motion.h"
#include "helicarm/track/body_series.h"
#include "helicarm/track/camera_errors.h"
#include "helicarm/track/delays.h"
#include "helicarm/track/dropped_frames.h"
#include "helicarm/track/exchanges.h"
#include "helicarm/track/first_shape.h"
#include "helicarm/track/image_errors.h"
#include "helicarm/track/place_markers.h"
#include "helicarm/track/view_map.h"

namespace helicarm::track {
namespace {

constexpr double sight_floor_px = 0.02;

bool is_posed(const BodySequence& body) {
  return std::ranges::any_of(body.frames, [](const TrackedBody& frame) { return frame.pose.has_value(); });
}

std::vector<MarkerDistance> distances_of(const SequenceData& work) {
  std::vector<MarkerDistance> distances;
  for (const BodyPlan& body : work.the_case.bodies)
    for (std::size_t i = 0; i < body.markers.size(); ++i)
      for (std::size_t k = i + 1; k < body.markers.size(); ++k) {
        double sum = 0, squares = 0;
        int count = 0;
        for (std::size_t f = 0; f < work.frames; ++f) {
          const auto &a = work.points[f][body.markers[i]], &b = work.points[f][body.markers[k]];
          if (!a || !b) continue;
          const double distance = (a->place - b->place).norm();
          sum += distance;
          squares += distance * distance;
          ++count;
        }
        if (count < 2) continue;
        const double mean = sum / count;
        distances.push_back({body.markers[i], body.markers[k], mean,
                             std::sqrt(std::max(0.0, squares - count * mean * mean) / (count - 1)), count});
      }
  return distances;
}

/// The images' sights, rectified.
SequenceData data_of(const TrackCase& the_case, const std::vector<FrameSights>& sights, Sequence& sequence) {
  SequenceData work{the_case, sights.size(), the_case.markers.size(), the_case.views.size(), {}, {}, {}, {}};
  for (const TrackView& view : the_case.views) work.cameras.push_back(view.camera);
  for (const FrameSights& frame : sights) {
    sequence.frames.push_back(frame.frame);
    sequence.repaired += frame.repaired;
    work.times.push_back(frame.frame);
    const auto lacking = too_many_repeated(frame.repeated, work.views);
    work.refused.push_back(lacking ? std::optional(lacking->reason()) : std::nullopt);
    auto& images = sequence.images.emplace_back();
    auto& of = work.sights.emplace_back(work.markers, std::vector<std::optional<Sight>>(work.views));
    for (std::size_t m = 0; m < work.markers; ++m)
      for (std::size_t k = 0; k < work.views; ++k) {
        const auto& image = frame.of[m][k];
        const auto uv = image ? rectified_in(the_case.views[k], image->uv_raw) : std::nullopt;
        images.push_back(uv ? image : std::nullopt);
        if (uv) of[m][k] = Sight{&work.cameras[k], *uv, std::hypot(image->sigma_px, sight_floor_px)};
      }
  }
  locate_all(work);
  return work;
}

void warn_of_lost_markers(const SequenceData& work, Sequence& sequence) {
  for (std::size_t m = 0; m < work.markers; ++m) {
    std::vector<int> lost;
    for (std::size_t f = 0; f < work.frames; ++f)
      if (sequence.markers[f][m].status == MarkerStatus::lost) lost.push_back(sequence.frames[f]);
    std::set<std::size_t> picked;
    for (const MarkerPick& pick : work.the_case.picks)
      if (pick.marker == m) picked.insert(pick.view);
    const bool never_placed = picked.size() == 1 && lost.size() == work.frames;
    if (!lost.empty())
      sequence.warnings.push_back(
          {Reason::marker_lost,
           fmt::format("\"{}\" is lost in {} of {} frames, first in frame {}: {}", work.the_case.markers[m],
                       lost.size(), work.frames, lost.front(),
                       never_placed ? "it is picked in one view only, which places nothing"
                                    : "hidden in both views for too long, outside the images or their "
                                      "distortion maps, or its discs are "
                                      "those of others"),
           {},
           {{"frames", double(lost.size())}, {"first", double(lost.front())}}});
  }
}

void warn_of_repeated_images(const TrackCase& the_case, const std::vector<FrameSights>& sights,
                             Sequence& sequence) {
  std::vector<std::vector<RepeatedImage>> of_frames;
  for (const FrameSights& frame : sights) of_frames.push_back(frame.repeated);
  for (Warning& warning : warnings_of_repeated(names_of_views(the_case), sequence.frames, of_frames))
    sequence.warnings.push_back(std::move(warning));
}

/// In a view that does not show them there.
void warn_of_places_outside_maps(const SequenceData& work, Sequence& sequence) {
  for (std::size_t k = 0; k < work.views; ++k) {
    const TrackView& view = work.the_case.views[k];
    if (!view.map || view.map->is_identity()) continue;
    for (std::size_t m = 0; m < work.markers; ++m) {
      std::vector<int> outside;
      for (std::size_t f = 0; f < work.frames; ++f) {
        const auto& place = sequence.markers[f][m].place;
        if (place && !work.sights[f][m][k] && view.camera.depth(place->place) > 1 &&
            !raw_in(view, view.camera.project(place->place)))
          outside.push_back(sequence.frames[f]);
      }
      if (outside.empty()) continue;
      sequence.warnings.push_back(
          {Reason::not_seen,
           fmt::format("\"{}\" is outside the distortion map of {} in {} of {} frames, first in frame {}: it "
                       "counts as hidden there",
                       work.the_case.markers[m], view.images.name, outside.size(), work.frames,
                       outside.front()),
           view.images.name,
           {{"frames", double(outside.size())}, {"first", double(outside.front())}}});
    }
  }
}

/// Markers in one bone keep their places to hundredths of a millimetre, also when it bends.
void warn_of_bodies_that_are_not_rigid(const SequenceData& work, Sequence& sequence) {
  constexpr double usual_mm = 0.25;
  for (std::size_t b = 0; b < sequence.bodies.size(); ++b) {
    const BodySequence& body = sequence.bodies[b];
    if (body.deviation_mm < usual_mm || body.markers.empty()) continue;
    if (std::ranges::any_of(body.markers, [](const PlacedMarker& one) { return one.moved_at.has_value(); }))
      continue;  // named already
    sequence.warnings.push_back(
        {Reason::marker_loose,
         fmt::format(
             "the markers of the body \"{}\" move by {:.2f} mm against each other: one moves in its bone, or "
             "is another body's, by exchanged names (\"distances\" in track.json); the body's poses are not "
             "better than this",
             work.the_case.bodies[b].name, body.deviation_mm),
         {},
         {{"deviation_mm", body.deviation_mm}}});
  }
}

std::vector<Joint> joints_of(const TrackCase& the_case, const std::vector<BodySequence>& bodies) {
  std::vector<Joint> joints;
  for (std::size_t i = 1; i < the_case.axes.size(); ++i) {
    const BodyAxes &reference = the_case.axes[0], &body = the_case.axes[i];
    Joint& joint = joints.emplace_back(Joint{reference.body, body.body, {}});
    for (std::size_t f = 0; f < bodies[body.body].smoothed.size(); ++f)
      joint.frames.push_back(
          joint_angles(bodies[reference.body].smoothed[f], reference, bodies[body.body].smoothed[f], body));
  }
  return joints;
}

/// Of a marker in the first view's first frame by its picks, px; nothing without picks that meet.
std::optional<double> expected_diameter_px(const SequenceData& work) {
  for (const MarkerPick& first : work.the_case.picks)
    for (const MarkerPick& other : work.the_case.picks) {
      if (first.marker != other.marker || first.view != 0 || other.view == 0) continue;
      std::vector<Sight> sights;
      for (const MarkerPick& pick : {first, other})
        if (const auto uv = rectified_in(work.the_case.views[pick.view], pick.uv_raw))
          sights.push_back({&work.cameras[pick.view], *uv, 1});
      const auto met = sights.size() == 2 ? sighted_point(sights) : std::nullopt;
      const double depth = met ? work.cameras[0].depth(met->place) : 0;
      if (depth > 0) return work.the_case.diameter_mm * std::abs(work.cameras[0].intrinsics.fy) / depth;
    }
  return std::nullopt;
}

/// Where no body has a pose in any frame, or without bodies most places are lost.
std::optional<Failure> nothing_followed(const SequenceData& work, const Sequence& sequence) {
  constexpr double most_lost = 0.5;
  double lost = 0;
  for (const auto& frame : sequence.markers)
    lost += double(std::ranges::count(frame, MarkerStatus::lost, &TrackedMarker::status));
  const double share = lost / double(work.frames * work.markers);
  const bool no_pose = std::ranges::none_of(sequence.bodies, is_posed);
  if (!no_pose || (sequence.bodies.empty() && share <= most_lost)) return std::nullopt;
  const auto px = expected_diameter_px(work);
  return Failure{
      Reason::marker_lost,
      fmt::format(
          "{:.0f} % of the places are lost{}: is \"diameter_mm\" that of the markers{}, were the cameras "
          "imported in their unit (cm, mm), is the camera of each view its own, and \"frame_offset\" right? "
          "The warnings name each marker",
          100 * share, sequence.bodies.empty() ? "" : ", and no body has a pose",
          px ? fmt::format(" ({:.0f} px wide by it and the cameras)", *px) : ""),
      {},
      {{"lost_share", share}}};
}

}  // namespace

Sequence estimate_sequence(const TrackCase& the_case, const std::vector<FrameSights>& sights) {
  Sequence sequence;
  sequence.warnings = the_case.warnings;
  SequenceData work = data_of(the_case, sights, sequence);
  warn_of_repeated_images(the_case, sights, sequence);
  repair_dropped_frames(work, sequence);
  repair_exchanges(work, sequence);
  if (const auto exchanged = exchanged_names(work)) {
    sequence.failure = exchanged->failure;
    work.refused.assign(work.frames, exchanged->failure.reason);
    for (const std::size_t marker : {exchanged->first, exchanged->second})
      for (std::size_t f = 0; f < work.frames; ++f) drop_sights(work, f, marker);
  }
  correct_delays(work, sequence);
  warn_of_delays(work, sequence);
  sequence.sigma_factor = sigma_factors(work);
  locate_all(work);
  sequence.correlation = correlation_of(work);
  sequence.lasting = lasting_share(work);
  sequence.distances = distances_of(work);
  std::vector<Estimated> bodies(the_case.bodies.size());
  sequence.bodies.resize(the_case.bodies.size());
  for (std::size_t b = 0; b < bodies.size(); ++b)
    estimate_body(work, the_case.bodies[b], bodies[b], sequence.bodies[b], sequence);
  for (std::size_t b = 0; b < bodies.size(); ++b)
    if (!is_posed(sequence.bodies[b])) drop_lone_discs(work, the_case.bodies[b]);
  place_markers(work, bodies, sequence);
  for (std::size_t f = 0; f < work.frames; ++f)
    sequence.complete += std::ranges::all_of(sequence.markers[f], [](const TrackedMarker& marker) {
      return marker.status == MarkerStatus::tracked;
    });
  warn_of_lost_markers(work, sequence);
  warn_of_places_outside_maps(work, sequence);
  warn_of_bodies_that_are_not_rigid(work, sequence);
  sequence.relative = relative_motions(sequence.bodies);
  sequence.joints = joints_of(the_case, sequence.bodies);
  add_camera_errors(work, sequence);
  if (!sequence.failure) sequence.failure = nothing_followed(work, sequence);
  return sequence;
}

}  // namespace helicarm::track
