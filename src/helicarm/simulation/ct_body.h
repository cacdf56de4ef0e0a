// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/simulation/scene.h"
#include "helicarm/volume/absorber.h"

namespace helicarm::simulation {

/// A patient's CT in place of the drawn knee, and how it is laid.
struct CtOptions {
  Volume volume;                                       ///< Hounsfield units
  std::string name;                                    ///< of its file, without folder
  std::optional<Eigen::Vector3d> centre = {};          ///< patient frame; none: the block's middle
  Eigen::Vector3d turn_deg = Eigen::Vector3d::Zero();  ///< about the knee's x, then y, then z
};

/// The knee's x is distal, y lateral, z anterior: from a patient on the back they are -S, L (of a left knee)
/// and -P; then `turn_deg`. The given centre comes to the knee's origin.
RigidTransform knee_from_patient(const CtOptions& options);

/// A CT as it weakens the three lines of the beam: below 0 HU air thinned water, above it water with a share
/// of cortical bone; 0 below -800 HU, where noise would add up.
class CtBody {
 public:
  CtBody(const CtOptions& options, const RigidTransform& world_from_knee, unsigned threads);

  /// Attenuation times length along each ray, at each line. The source must not be inside.
  void add_depths(const Eigen::Vector3d& source, std::span<const Eigen::Vector3d> directions,
                  std::span<Eigen::Array3d> depths) const;
  bool contains(const Eigen::Vector3d& point_in_world) const;

 private:
  RigidTransform patient_from_world_;
  Absorber water_;
  Absorber bone_;
};

}  // namespace helicarm::simulation
