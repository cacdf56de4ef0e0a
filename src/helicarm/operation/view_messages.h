// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/devices/tracker/igtl_message.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::operation {

/// Plane in which an image lies, from the source, whose detector has no known pixel size and whose source the
/// world's origin does not face.
inline constexpr double usual_plane_mm = 1000;

/// Of each calibrated view the rectified image at its detector's place (IMAGE, named as the view) and the
/// camera (TRANSFORM, NAME_camera: source as origin, z towards the detector), both in the calibrator's frame
/// as LPS, which is sent as RAS: x and y change sign, a matrix M becomes S M S, S = diag(-1, -1, 1, 1).
/// Without a known pixel size the image lies as far behind the world's origin as the source before it. A name
/// of more than 13 characters becomes V1, V2, ... Fails with the result's own failure.
Expected<std::vector<tracker::IgtlMessage>> messages_of_views(const pipeline::Result& result);

}  // namespace helicarm::operation
