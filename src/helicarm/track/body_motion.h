// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/track/body_shape.h"

namespace helicarm::track {

/// What is estimated of a body on the way to its `BodySequence`.
struct Estimated {
  Shape shape;
  std::vector<char> counts;
  std::vector<std::optional<FramePose>> poses;  // world_from_body of the body's own frame
  std::vector<Eigen::Matrix3d> spread;          // of each marker about its place by the others, body frame
  std::vector<Eigen::Matrix3d> by_place;        // of its place in the body, body frame
  std::optional<SmoothMotion> motion;
  std::vector<std::optional<std::size_t>> dropped;  // of each frame: the marker that its pose leaves out
};

/// A body's geometry, poses and motion; one whose markers do not determine its poses has none, and a warning
/// says why. The standard deviations of its markers' images are what they miss the body by afterwards.
void estimate_body(SequenceData& work, const BodyPlan& plan, Estimated& at, BodySequence& body,
                   Sequence& sequence);

/// The place of a marker by the other markers of its body in this frame; or, unless `by_others`, by the
/// body's smooth motion where they are too few.
std::optional<FramePlace> place_by_body(const SequenceData& work, const BodyPlan& plan, const Estimated& at,
                                        const BodySequence& body, std::size_t i, std::size_t f,
                                        bool by_others);

}  // namespace helicarm::track
