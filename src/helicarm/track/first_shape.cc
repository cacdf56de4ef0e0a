// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/first_shape.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace helicarm::track {
namespace {

/// Farther from its place, mm, a disc is another marker's.
double farthest_mm(const SequenceData& work, const Eigen::Vector3d& place) {
  constexpr double least_mm = 3, beside_pick_px = 12;
  double mm_per_px = 0;
  for (const geometry::View& camera : work.cameras)
    mm_per_px = std::max(mm_per_px, camera.depth(place) / std::abs(camera.intrinsics.fy));
  return std::max(least_mm, beside_pick_px * mm_per_px);
}

struct Located {
  std::size_t marker;  // of the body
  Eigen::Vector3d first, now;
};

/// Those of the frame that are located in the first one too.
std::vector<Located> located_in(const SequenceData& work, const BodyPlan& plan, std::size_t f) {
  std::vector<Located> located;
  for (std::size_t i = 0; i < plan.markers.size(); ++i) {
    const auto &first = work.points[0][plan.markers[i]], &now = work.points[f][plan.markers[i]];
    if (first && now) located.push_back({i, first->place, now->place});
  }
  return located;
}

/// By a person.
bool is_corrected(const TrackCase& the_case, int frame, std::size_t marker) {
  return std::ranges::any_of(the_case.corrections, [&](const MarkerPick& pick) {
    return pick.marker == marker && pick.frame == frame;
  });
}

bool agree(const Located& a, const Located& b, double limit_mm) {
  return std::abs((a.first - b.first).norm() - (a.now - b.now).norm()) < limit_mm;
}

/// The largest set that is found whose distances are those of the first frame.
std::vector<Located> agreeing(const std::vector<Located>& located, double limit_mm) {
  std::vector<Located> largest;
  for (const Located& seed : located) {
    std::vector<Located> set{seed};
    for (const Located& other : located)
      if (other.marker != seed.marker &&
          std::ranges::all_of(set, [&](const Located& each) { return agree(each, other, limit_mm); }))
        set.push_back(other);
    if (set.size() > largest.size()) largest = std::move(set);
  }
  // Distances do not tell a mirror image.
  while (largest.size() >= 3) {
    std::vector<Eigen::Vector3d> first, now;
    for (const Located& each : largest) {
      first.push_back(each.first);
      now.push_back(each.now);
    }
    const RigidTransform pose = geometry::absolute_pose(first, now);
    const auto off = [&](const Located& each) { return (pose * each.first - each.now).norm(); };
    const auto worst = std::ranges::max_element(largest, {}, off);
    if (off(*worst) < limit_mm) break;
    largest.erase(worst);
  }
  return largest;
}

}  // namespace

std::optional<OddMarker> contradiction_of_first(const SequenceData& work, const BodyPlan& plan,
                                                const Estimated& at, const BodySequence& body) {
  if (!plan.geometry.empty() || !work.the_case.points.empty()) return std::nullopt;
  std::vector<Eigen::Vector3d> in_body, places;
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < plan.markers.size(); ++i)
    if (const auto& point = work.points[0][plan.markers[i]];
        point && at.counts[i] && at.shape.in_body[i] && !body.markers[i].moved_at) {
      in_body.push_back(*at.shape.in_body[i]);
      places.push_back(point->place);
      indices.push_back(i);
    }
  if (places.size() < 3) return std::nullopt;
  const RigidTransform pose = at.poses[0] ? at.poses[0]->pose : geometry::absolute_pose(in_body, places);
  std::optional<OddMarker> worst;
  double most = farthest_mm(work, geometry::mean_of(places));
  for (std::size_t i = 0; i < places.size(); ++i)
    if (const double off = (pose * in_body[i] - places[i]).norm(); off > most) {
      worst = {indices[i], off};
      most = off;
    }
  return worst;
}

void drop_contradicting(SequenceData& work, const BodyPlan& plan, Sequence& sequence) {
  struct Odd {
    int seen = 0, frames = 0;
    std::size_t first = 0;
  };
  std::vector<Odd> odd(plan.markers.size());
  int untold = 0;
  std::optional<std::size_t> first_untold;
  for (std::size_t f = 1; f < work.frames; ++f) {
    const std::vector<Located> located = located_in(work, plan, f);
    if (located.size() < 3) continue;  // the body's motion judges so few
    const auto set = agreeing(located, farthest_mm(work, located.front().now));
    const bool is_told = set.size() >= 3;
    if (!is_told) {
      ++untold;
      if (!first_untold) first_untold = f;
    }
    for (const Located& each : located) {
      if (is_told) ++odd[each.marker].seen;
      if (is_told && std::ranges::count(set, each.marker, &Located::marker) > 0) continue;
      if (is_corrected(work.the_case, sequence.frames[f], plan.markers[each.marker])) continue;
      if (is_told && odd[each.marker].frames++ == 0) odd[each.marker].first = f;
      drop_sights(work, f, plan.markers[each.marker]);
    }
  }
  if (untold > 0)
    sequence.warnings.push_back(
        {Reason::marker_lost,
         fmt::format("in {} frames, first in frame {}, fewer than three markers of the body \"{}\" are where "
                     "frame {} has them beside each other: other discs are followed there, and none counts; "
                     "pick them there",
                     untold, sequence.frames[*first_untold], plan.name, sequence.frames.front()),
         {},
         {{"frames", double(untold)}, {"first", double(sequence.frames[*first_untold])}}});
  for (std::size_t i = 0; i < plan.markers.size(); ++i) {
    if (odd[i].frames == 0) continue;
    const bool is_unknown = 2 * odd[i].frames > odd[i].seen;
    if (is_unknown)
      for (std::size_t f = 0; f < work.frames; ++f) drop_sights(work, f, plan.markers[i]);
    sequence.warnings.push_back(
        {Reason::marker_lost,
         fmt::format("the disc of \"{}\" is not where frame {} has it in the body \"{}\" in {} of {} frames, "
                     "first in frame {}, {}",
                     work.the_case.markers[plan.markers[i]], sequence.frames.front(), plan.name,
                     odd[i].frames, odd[i].seen, sequence.frames[odd[i].first],
                     is_unknown ? "and counts in none: its pick may be wrong as well; correct it, or pick "
                                  "the marker in these frames"
                                : "and does not count there: pick it there"),
         {},
         {{"frames", double(odd[i].frames)}, {"first", double(sequence.frames[odd[i].first])}}});
  }
}

void drop_lone_discs(SequenceData& work, const BodyPlan& plan) {
  constexpr double rigid_mm = 1;
  if (plan.markers.size() < 3 || !work.the_case.points.empty()) return;
  for (std::size_t f = 1; f < work.frames; ++f) {
    const std::vector<Located> located = located_in(work, plan, f);
    const auto is_lone = [&](const Located& each) {
      return std::ranges::none_of(located, [&](const Located& other) {
        return other.marker != each.marker && agree(other, each, rigid_mm);
      });
    };
    for (std::size_t i = 0; i < plan.markers.size(); ++i) {
      const auto found = std::ranges::find(located, i, &Located::marker);
      if (work.points[f][plan.markers[i]] && (found == located.end() || is_lone(*found)))
        drop_sights(work, f, plan.markers[i]);
    }
  }
}

}  // namespace helicarm::track
