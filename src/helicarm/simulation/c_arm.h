// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/geometry/view.h"
#include "helicarm/simulation/develop.h"
#include "helicarm/simulation/render_view.h"
#include "helicarm/simulation/simulation_options.h"

namespace helicarm::simulation {

/// A make of C-arm, as its data sheet has it.
struct CArmModel {
  bool intensifier;    ///< round field, distortion and plate; else a flat panel
  double receiver_mm;  ///< side of the picture
  double source_detector_mm;
  double source_isocentre_mm;
};

CArmModel model_of(Preset preset);

/// The C-arm as it truly stands when one view is taken.
struct Shot {
  std::string name;
  View view;  ///< to ideal pixels before any mirroring; world = calibrator
  VirtualDetector detector;
  Imaging imaging;
  RigidTransform camera_from_plate;  ///< origin in the plate's plane
  bool mirrored = false;             ///< the stored picture is flipped left to right
  double f_mm = 0;
  double nominal_f_mm = 0;       ///< what the tag says
  double primary_angle_deg = 0;  ///< tags, rounded
  double secondary_angle_deg = 0;

  double pixel_mm() const { return detector.pixel_mm; }
  /// K of the stored picture: fx < 0 where it is mirrored.
  View stored_view() const;
  /// Both in the stored picture, mirrored or not.
  Eigen::Vector2d ideal_image(const Eigen::Vector3d& point_in_calibrator) const;
  Eigen::Vector2d raw_image(const Eigen::Vector3d& point_in_calibrator) const;
};

/// An AP and a lateral view of the calibrator, with the seed's own sag, tilt and distortion; of paper_sim
/// exactly those of 2.3.3, about the middle of the cone.
std::vector<Shot> take_stand(const SimulationOptions& options, double plate_height_mm,
                             const RigidTransform& calibrator_from_patient);

}  // namespace helicarm::simulation
