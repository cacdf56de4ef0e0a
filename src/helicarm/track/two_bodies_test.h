// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "helicarm/geometry/rotation.h"
#include "helicarm/track/sequence.h"
#include "helicarm/track/two_cameras_test.h"

/// A jaw and a skull of four markers each, and what two cameras see of them in forty frames.
namespace helicarm::track::two_bodies_test {

inline constexpr double noise_px = 0.05;

inline constexpr int frames = 40;

inline const std::vector<std::vector<Eigen::Vector3d>> bodies{
    {{10, 0, 3}, {-8, 7, -4}, {2, -9, 8}, {-5, -6, -9}},
    {{9, 12, 25}, {-12, 3, 31}, {4, -11, 22}, {-3, 14, 36}}};

inline TrackCase two_bodies() {
  TrackCase the_case;
  for (const geometry::View& camera : two_cameras()) {
    TrackView& view = the_case.views.emplace_back();
    view.images.name = the_case.views.size() == 1 ? "A" : "B";
    view.camera = camera;
  }
  for (const auto& body : bodies) {
    BodyPlan& plan = the_case.bodies.emplace_back();
    plan.name = the_case.bodies.size() == 1 ? "jaw" : "skull";
    for (std::size_t i = 0; i < body.size(); ++i) {
      plan.markers.push_back(the_case.markers.size());
      the_case.markers.push_back(plan.name[0] + std::to_string(i + 1));
    }
  }
  return the_case;
}

inline geometry::RigidTransform pose_at(std::size_t body, int frame) {
  const double t = 0.1 * frame, sign = body == 0 ? 1 : -1;
  return {geometry::rotation_from_vector({0.1 * std::sin(t), sign * 0.05 * t, 0}),
          {3 * std::sin(t), sign * 2 * t, std::cos(t)}};
}

using Shift = std::function<Eigen::Vector3d(std::size_t marker, int frame)>;

inline Eigen::Vector3d place_of(std::size_t marker, int frame, const Shift& shift) {
  const std::size_t body = marker / 4;
  return pose_at(body, frame) * (bodies[body][marker % 4] + shift(marker, frame));
}

inline Eigen::Vector2d normal_pair(std::normal_distribution<double>& normal, std::mt19937& random) {
  const double y = normal(random), x = normal(random);
  return {x, y};
}

inline std::vector<FrameSights> drawn(const TrackCase& the_case, const Shift& shift) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal;
  std::vector<FrameSights> made;
  for (int f = 1; f <= frames; ++f) {
    FrameSights& sights = made.emplace_back();
    sights.frame = f;
    for (std::size_t m = 0; m < the_case.markers.size(); ++m) {
      auto& of = sights.of.emplace_back();
      for (const TrackView& view : the_case.views)
        of.push_back(
            MarkerImage{view.camera.project(place_of(m, f, shift)) + noise_px * normal_pair(normal, random),
                        noise_px, 2, 60, 120});
    }
  }
  return made;
}

inline Eigen::Vector3d none(std::size_t, int) { return Eigen::Vector3d::Zero(); }

/// Of all places; infinite where one is missing, but of a marker that is to have none.
inline double farthest(const Sequence& sequence, const Shift& shift, std::optional<std::size_t> lost = {}) {
  double most = 0;
  for (std::size_t f = 0; f < sequence.frames.size(); ++f)
    for (std::size_t m = 0; m < sequence.markers[f].size(); ++m)
      if (const auto& place = sequence.markers[f][m].place; m != lost)
        most = std::max(most, place ? (place->place - place_of(m, int(f) + 1, shift)).norm()
                                    : std::numeric_limits<double>::infinity());
  return most;
}

inline const Warning* warning_of(const Sequence& sequence, Reason reason) {
  const auto found = std::ranges::find(sequence.warnings, reason, &Warning::reason);
  return found == sequence.warnings.end() ? nullptr : &*found;
}

inline std::vector<MarkerStatus> statuses_of(const Sequence& sequence, std::size_t marker) {
  std::vector<MarkerStatus> made;
  for (const auto& frame : sequence.markers) made.push_back(frame[marker].status);
  return made;
}

}  // namespace helicarm::track::two_bodies_test
