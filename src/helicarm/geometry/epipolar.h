// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"

namespace helicarm {

/// Where the ray that made pixel `uv` of one view shows in another: points of the ray at depths (from the
/// first source, along its central ray) evenly from `near_mm` to `far_mm`, projected. They lie on the
/// epipolar line. Points less than 1 mm before the other source are left out.
std::vector<Eigen::Vector2d> epipolar_line(const View& from, const Eigen::Vector2d& uv, const View& onto,
                                           double near_mm, double far_mm);

}  // namespace helicarm
