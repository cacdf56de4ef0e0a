// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/simulation/scene.h"
#include "helicarm/volume/absorber.h"

namespace helicarm::simulation {

/// A patient's CT used instead of the modelled knee, and its placement.
struct CtOptions {
  volume::Volume volume;                               ///< Hounsfield units
  std::string name;                                    ///< file name without folder
  std::optional<Eigen::Vector3d> centre = {};          ///< patient frame; default: centre of the volume
  Eigen::Vector3d turn_deg = Eigen::Vector3d::Zero();  ///< about the knee's x, then y, then z
};

/// The knee's x is distal, y lateral, z anterior: for a supine patient these are -S, L (of a left knee) and
/// -P; then `turn_deg` is applied. The given centre maps to the knee's origin.
geometry::RigidTransform knee_from_patient(const CtOptions& options);

/// Attenuation of a CT at the beam's three lines: below 0 HU a mixture of air and water, above a mixture of
/// water and cortical bone; 0 below -800 HU, where noise would accumulate.
class CtBody {
 public:
  CtBody(const CtOptions& options, const geometry::RigidTransform& world_from_knee, unsigned threads);

  /// Adds attenuation times length along each ray, at each line. The source must be outside.
  void add_depths(const Eigen::Vector3d& source, std::span<const Eigen::Vector3d> directions,
                  std::span<Eigen::Array3d> depths) const;
  bool contains(const Eigen::Vector3d& point_in_world) const;

 private:
  geometry::RigidTransform patient_from_world_;
  volume::Absorber water_;
  volume::Absorber bone_;
};

}  // namespace helicarm::simulation
