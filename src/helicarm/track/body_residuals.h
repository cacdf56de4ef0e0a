// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/track/body_motion.h"

namespace helicarm::track {

/// Raises the standard deviations of each marker's images in each view to what they miss the body's poses by,
/// in both directions of the image (score of the restricted likelihood; few frames count less). Texture that
/// moves with a marker displaces its image for many frames, and ray gaps show one direction of two.
void raise_to_residuals(SequenceData& work, const BodyPlan& plan, const Estimated& at, double loose_mm);

}  // namespace helicarm::track
