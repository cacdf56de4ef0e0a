// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/registration/surface.h"

namespace helicarm::registration {

/// Points, about 1 mm apart, of the flat ends at which the volume cut a bone's surface off: at least 0.5 % of
/// the surface in one plane, nothing of the body beyond it, and a wall that goes on straight behind it.
/// Empty: none.
std::vector<Eigen::Vector3d> flat_cut(const Surface& surface);

}  // namespace helicarm::registration
