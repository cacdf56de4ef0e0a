// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>

#include "helicarm/phantom/body.h"

namespace helicarm::phantom {

/// Bodies for any layout of balls (BodyShape::rings and plate).
SignedDistance open_body_distance(const Calibrator& calibrator, const BodyOptions& options);

/// Around such a body, with two steps of margin.
Eigen::AlignedBox3d open_body_box(const Calibrator& calibrator, const BodyOptions& options);

/// Refuses (bad_value) a ball of rings into whose seat another one's pocket reaches.
Expected<void> check_pockets(const Calibrator& calibrator, const BodyOptions& options);

/// Refuses (bad_value) a ball that a post of the plate would pass or block.
Expected<void> check_posts(const Calibrator& calibrator, const BodyOptions& options);

/// Pocket of a ball, open along a direction.
double pocket_distance(const CalibratorBall& ball, const Eigen::Vector3d& outward, double clearance_mm,
                       const Eigen::Vector3d& point);

}  // namespace helicarm::phantom
