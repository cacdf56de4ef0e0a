// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace helicarm::fiducials {

/// Standard deviation per axis, px, of a fiducial's centre in a raw image beside what the image's noise and
/// background cause: of the model of the ball's profile.
inline constexpr double sigma_floor_px = 0.02;

}  // namespace helicarm::fiducials
