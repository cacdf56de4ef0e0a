// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"

namespace helicarm::geometry {

/// The ray through pixel `uv` of one view, projected into another: points at depths (from the first source
/// along its central ray) evenly spaced from `near_mm` to `far_mm`. They lie on the epipolar line. Points
/// less than 1 mm in front of the other source are omitted.
std::vector<Eigen::Vector2d> epipolar_line(const View& from, const Eigen::Vector2d& uv, const View& onto,
                                           double near_mm, double far_mm);

}  // namespace helicarm::geometry
