// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "helicarm/core/random.h"
#include "helicarm/simulation/intensifier_distortion.h"
#include "helicarm/simulation/simulation_options.h"

namespace helicarm::simulation {

/// A C-arm model with its data sheet values.
struct CArmModel {
  bool intensifier;    ///< round field, distortion and plate; else a flat panel
  double receiver_mm;  ///< side of the image
  double source_detector_mm;
  double source_isocentre_mm;
};

CArmModel model_of(Preset preset);

/// State of one C-arm at one angle. Camera axes: x right, y down, z from the source to the receiver.
struct ArmState {
  double f_mm;
  Eigen::Vector2d principal_mm;  ///< from the image centre
  Eigen::Vector3d source_mm;     ///< offset from its position in an undeformed arm
  double roll_deg;               ///< of the image about its axis
  double s_rotation;             ///< of the intensifier's S, rad
  Eigen::Vector2d shift_mm;      ///< of the intensifier's image
};

/// One C-arm with its systematic errors: gravity bends the arm and the earth's magnetic field deflects the
/// intensifier's electrons, so both depend smoothly and reproducibly on the pose.
struct ArmFlex {
  double f_mm;
  Eigen::Vector2d principal_mm;
  double roll_deg;
  // Per unit weight, as a unit vector (down) along the camera's axes.
  Eigen::RowVector3d f_per_weight;
  Eigen::Matrix2d principal_per_weight;  ///< per component across the beam
  Eigen::Matrix3d source_per_weight;
  Eigen::RowVector3d roll_per_weight;
  IntensifierDistortion distortion;  ///< without S and shift, px
  Eigen::Vector3d field_in_patient;  ///< direction of the earth's field
  double s_rotation;                 ///< for a field along the beam
  double shift_mm;                   ///< for a field across the beam

  /// `camera_from_patient`: orientation of the arm; patient: x distal, y lateral, z up.
  ArmState at(const Eigen::Matrix3d& camera_from_patient) const;
};

/// The C-arm of a seed.
ArmFlex draw_arm(std::uint64_t seed, const CArmModel& model, int size);

/// Adds the part that does not repeat when the arm returns to an angle.
ArmState unrepeated(const ArmState& state, RandomStream& random);

}  // namespace helicarm::simulation
