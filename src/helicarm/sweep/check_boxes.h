// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/sweep/reconstruction_check.h"
#include "helicarm/sweep/sweep.h"

namespace helicarm::sweep {

/// A box about a target, its z along the axis or the wire.
struct CheckBox {
  std::string name;
  std::optional<double> diameter_mm;  ///< nothing: a wire
  geometry::RigidTransform world_from_box;
  std::array<int, 3> size{0, 0, 0};
  double voxel_mm = 0;

  /// Half of the box's sides, mm.
  Eigen::Vector3d half() const { return Eigen::Vector3d(size[0], size[1], size[2]) * voxel_mm / 2; }
};

/// Cameras of the used frames.
using Cameras = std::vector<geometry::View>;

/// A wire that the calibrator's file describes by its end.
std::optional<Wire> wire_of(const phantom::Calibrator& calibrator);

CheckBox box_of_wire(const Wire& wire);

/// Up to four balls in the field of all images and clear of their neighbours, far from each other; the first
/// is the middle one.
std::vector<CheckBox> boxes_of_balls(const phantom::Calibrator& calibrator, const Sweep& sweep,
                                     const Cameras& own);

/// mm, calibrator frame.
std::vector<Eigen::Vector3d> corners_of(const CheckBox& box);

/// The box where the target appears with other cameras, by their rays through its images: a circle about
/// another centre, or another world, displaces it as a whole.
CheckBox as_seen_by(const Cameras& cameras, CheckBox box, const Cameras& own);

}  // namespace helicarm::sweep
