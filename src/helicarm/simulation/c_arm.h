// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/geometry/view.h"
#include "helicarm/simulation/arm_flex.h"
#include "helicarm/simulation/detector_response.h"
#include "helicarm/simulation/render_view.h"
#include "helicarm/simulation/simulation_options.h"

namespace helicarm::simulation {

/// The C-arm as it truly stands when one view is taken.
struct TrueView {
  std::string name;
  std::uint32_t number = 0;  ///< in the case, from 0
  View view;                 ///< to ideal pixels before any mirroring; world = calibrator
  VirtualDetector detector;
  Imaging imaging;
  RigidTransform camera_from_plate;  ///< origin in the plate's plane
  bool mirrored = false;             ///< the stored image is flipped left to right
  double f_mm = 0;
  double nominal_f_mm = 0;  ///< what the tag says
  ArmAngles true_angles;
  double primary_angle_deg = 0;  ///< tags, rounded
  double secondary_angle_deg = 0;

  double pixel_mm() const { return detector.pixel_mm; }
  /// K of the stored image: fx < 0 where it is mirrored.
  View stored_view() const;
  /// Both in the stored image, mirrored or not.
  Eigen::Vector2d ideal_image(const Eigen::Vector3d& point_in_calibrator) const;
  Eigen::Vector2d raw_image(const Eigen::Vector3d& point_in_calibrator) const;
};

/// The views asked for, or an AP and a lateral one, by the C-arm of the arm's seed: two views at one angle
/// share its flex and distortion but for a little. Of paper_sim exactly the poses of 2.3.3, about the middle
/// of the cone.
std::vector<TrueView> take_stand(const SimulationOptions& options, double plate_height_mm,
                                 const RigidTransform& calibrator_from_patient);

}  // namespace helicarm::simulation
