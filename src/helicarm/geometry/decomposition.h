// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"

namespace helicarm::geometry {

/// The view whose projection equals a 3x4 matrix up to scale and sign: fy > 0, a proper rotation, fx < 0 for
/// a mirrored image. The sign of the matrix is chosen so that the given point lies in front of the source;
/// without a point, so that the image is not mirrored (det of the left 3x3 > 0). Refuses numbers that are not
/// finite (`not_finite`) and a source at infinity (`point_at_infinity`).
Expected<View> decompose(const Projection& projection);
Expected<View> decompose(const Projection& projection, const Eigen::Vector3d& point_in_front);

}  // namespace helicarm::geometry
