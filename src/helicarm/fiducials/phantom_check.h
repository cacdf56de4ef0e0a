// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm::fiducials {

/// A motion after which every ball lies close to the place of one of the same diameter.
struct NearSymmetry {
  bool mirror = false;  ///< with a reflection
  double rms_mm = 0;
  double turn_deg = 0;  ///< of the rotation
  std::vector<std::pair<std::string, std::string>>
      moves;  ///< ball, and the ball at whose place it comes to lie
};

/// The calibrator seen from one direction.
struct SeenDirection {
  Eigen::Vector3d beam;            ///< unit, in the calibrator's frame
  double margin = 0;               ///< log odds over the best other labelling; 0 if refused
  std::optional<Failure> refused;  ///< of the labelling
  bool mirror = false;             ///< the rival is a mirror image
};

/// Two balls whose images overlap.
struct HidingPair {
  std::string a, b;
  std::size_t directions = 0;  ///< from which they do
};

struct PhantomCheck {
  std::vector<SeenDirection> directions;
  std::optional<NearSymmetry> rotation, mirror;  ///< of least rms, if below 2 mm
  std::vector<HidingPair> hiding;                ///< most directions first

  std::size_t refused() const;
};

struct PhantomCheckOptions {
  std::size_t directions = 60;  ///< evenly over the sphere
  double source_detector_mm = 1000;
  double source_calibrator_mm = 650;
  double pixel_mm = 0.23;
  int size_px = 1024;
  double sigma_px = 0.15;  ///< of a fiducial's image, per axis
  unsigned threads = 0;
};

/// Labels exact images of the calibrator from all directions, in unknown handedness, with `label_balls`:
/// where another labelling explains the image as well, the calibrator is symmetric to the labelling. Where
/// balls overlap, only the nearer to the source is an image point.
PhantomCheck check_phantom(const phantom::Calibrator& calibrator, const PhantomCheckOptions& options = {});

/// The rotation (or reflection with rotation) other than the identity that brings the balls closest to each
/// other's places; nothing beyond `limit_mm` rms.
std::optional<NearSymmetry> near_symmetry(const phantom::Calibrator& calibrator, bool mirror,
                                          double limit_mm = 2);

}  // namespace helicarm::fiducials
