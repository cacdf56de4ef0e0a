// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/geometry/view.h"
#include "helicarm/registration/model.h"

namespace helicarm::registration {

/// Pixels to draw over a view: the apparent contour of a surface, the edges of a volume's DRR (ridges of its
/// gradient, one point per `step_px`).
std::vector<Eigen::Vector2d> outline(const Model& model, const geometry::View& view,
                                     const geometry::RigidTransform& world_from_model, double step_px);

}  // namespace helicarm::registration
