// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/phantom/plate.h"
#include "helicarm/simulation/scene.h"

namespace helicarm::simulation {

/// The plastic cone around the balls in the calibrator's frame: its wall (r = radius + slope z) follows the
/// balls' centres.
struct ConeWall {
  double radius_mm;
  double slope;
  double bottom_mm;
  double top_mm;

  double radius_at(double z) const { return radius_mm + slope * z; }
};

/// Least squares through the balls, from 6 mm below the lowest to 8 mm above the highest.
ConeWall cone_wall(const phantom::Calibrator& calibrator);

/// Check targets as in the paper's 3.2: a 3 mm ball on a post, two wire crosses on the wall, the two ends of
/// one wire on the top.
std::vector<phantom::CalibratorTarget> check_targets(const phantom::Calibrator& calibrator);

/// The manufactured calibrator: steel balls and targets, plastic cone, flange, top disc and posts. Balls that
/// do not lie on a cone about z are held by plastic spheres instead.
Scene calibrator_body(const phantom::Calibrator& calibrator);

/// Name of the body of a plate dot.
std::string plate_dot_name(std::size_t index);

/// The dots of a plate: the file's, or of an unbounded lattice those within `radius_mm` of its origin.
/// Refuses (bad_value) a lattice without dots and pitch.
Expected<std::vector<Eigen::Vector2d>> dots_within(const phantom::Plate& plate, double radius_mm);

/// The plate's balls on the receiver, or a steel sheet with its holes. `camera_from_plate` has its origin in
/// the plate's plane.
Scene plate_body(const phantom::Plate& plate, const geometry::RigidTransform& camera_from_plate,
                 const geometry::View& view);

}  // namespace helicarm::simulation
