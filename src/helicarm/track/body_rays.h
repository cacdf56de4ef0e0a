// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/track/body_motion.h"

namespace helicarm::track {

/// A marker's place in its body by all its images, most of them of one view, along the body's poses.
struct PlaceByRays {
  FramePlace place;     ///< body frame
  int determining = 0;  ///< images that agree with it
};

/// For a marker that two views show in too few frames: its images in every frame in which its body has a
/// pose, and its picks in the first, robustly. `independent`: frames among which errors are independent, over
/// all frames; `lasting`: the part of the errors' variance that no mean of frames reduces. Nothing where they
/// leave the place open.
std::optional<PlaceByRays> place_by_rays(const SequenceData& work, const BodyPlan& plan, const Estimated& at,
                                         std::size_t i, double independent, double lasting);

}  // namespace helicarm::track
