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

/// Ground truth of the C-arm for one view.
struct TrueView {
  std::string name;
  std::uint32_t number = 0;  ///< in the case, from 0
  geometry::View view;       ///< projects to ideal pixels before mirroring; world = calibrator
  VirtualDetector detector;
  Imaging imaging;
  geometry::RigidTransform camera_from_plate;  ///< origin in the plate's plane
  bool mirrored = false;                       ///< the stored image is flipped left to right
  double f_mm = 0;
  double nominal_f_mm = 0;  ///< value in the tag
  ArmAngles true_angles;
  double primary_angle_deg = 0;  ///< tags, rounded
  double secondary_angle_deg = 0;

  double pixel_mm() const { return detector.pixel_mm; }
  /// View with the K of the stored image: fx < 0 if it is mirrored.
  geometry::View stored_view() const;
  /// Pixels of the stored image, mirrored or not.
  Eigen::Vector2d ideal_image(const Eigen::Vector3d& point_in_calibrator) const;
  Eigen::Vector2d raw_image(const Eigen::Vector3d& point_in_calibrator) const;
};

/// The requested views, or an AP and a lateral one, by the C-arm of the arm's seed: two views at one angle
/// share its flex and distortion except for a small random part. For paper_sim exactly the poses of 2.3.3
/// about the middle of the cone.
std::vector<TrueView> take_stand(const SimulationOptions& options, double plate_height_mm,
                                 const geometry::RigidTransform& calibrator_from_patient);

}  // namespace helicarm::simulation
