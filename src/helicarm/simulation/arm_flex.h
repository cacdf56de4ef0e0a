// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "helicarm/core/random.h"
#include "helicarm/simulation/intensifier_distortion.h"
#include "helicarm/simulation/simulation_options.h"

namespace helicarm::simulation {

/// A make of C-arm, as its data sheet has it.
struct CArmModel {
  bool intensifier;    ///< round field, distortion and plate; else a flat panel
  double receiver_mm;  ///< side of the image
  double source_detector_mm;
  double source_isocentre_mm;
};

CArmModel model_of(Preset preset);

/// What one C-arm does at one angle. Camera axes: x right, y down, z from the source to the receiver.
struct ArmState {
  double f_mm;
  Eigen::Vector2d principal_mm;  ///< from the image's middle
  Eigen::Vector3d source_mm;     ///< from its place in an unbent arm
  double roll_deg;               ///< of the image about its axis
  double s_rotation;             ///< of the intensifier's S, rad
  Eigen::Vector2d shift_mm;      ///< of the intensifier's image
};

/// One C-arm with its faults: it bends under its own weight, and its intensifier's electrons go astray in the
/// earth's field, so both depend on where it points, smoothly and each time alike.
struct ArmFlex {
  double f_mm;
  Eigen::Vector2d principal_mm;
  double roll_deg;
  // Per weight, as a unit vector (down) along the camera's axes.
  Eigen::RowVector3d f_per_weight;
  Eigen::Matrix2d principal_per_weight;  ///< of its part across the beam
  Eigen::Matrix3d source_per_weight;
  Eigen::RowVector3d roll_per_weight;
  IntensifierDistortion distortion;  ///< without S and shift, px
  Eigen::Vector3d field_in_patient;  ///< the earth's field's direction
  double s_rotation;                 ///< where it lies along the beam, rad
  double shift_mm;                   ///< where it lies across

  /// `camera_from_patient`: where the arm points; patient: x distal, y lateral, z up.
  ArmState at(const Eigen::Matrix3d& camera_from_patient) const;
};

/// The C-arm of a seed.
ArmFlex draw_arm(std::uint64_t seed, const CArmModel& model, int size);

/// The little that is not alike the next time the arm comes to the angle.
ArmState unrepeated(const ArmState& state, RandomStream& random);

}  // namespace helicarm::simulation
