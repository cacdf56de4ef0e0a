// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/core/random.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm::simulation {

/// A disc as returned by a detector.
struct SyntheticDetection {
  Eigen::Vector2d uv;  ///< rectified pixels
  double sigma_px;     ///< per axis
  double radius_px;
  double radius_sigma_px;  ///< without the bias common to all
  int ball = -1;           ///< -1: outlier, or two balls merged
};

enum class OutlierKind {
  uniform,    ///< anywhere in the field, half of them among the balls
  imitating,  ///< the first a few pixels from the position of a hidden ball, the others uniform
  lattice     ///< on a square lattice, like plate dots mistaken for balls
};

struct SyntheticDetectionOptions {
  int hidden = 0;
  int outliers = 0;
  OutlierKind kind = OutlierKind::uniform;
  double noise_px = 0.5;
  std::optional<bool> mirrored = {};  ///< empty: random
};

/// A calibrator seen from any direction by a C-arm with only nominal values known. No pixels are rendered.
struct SyntheticView {
  geometry::View view;  ///< world = calibrator; a mirrored image has fx < 0
  std::vector<SyntheticDetection> detections;
  int visible = 0;  ///< balls with a detection of their own
  double radius_bias = 0;

  bool mirrored() const { return view.intrinsics.fx < 0; }
};

/// Nominal values in the file: true f within 1 %, the principal point within 55 px.
struct NominalCamera {
  double focal_px = 4345;
  Eigen::Vector2d principal_px{511.5, 511.5};
  double field_radius_px = 504;
};

/// The calibrator's centre is 550 to 920 mm from the source, up to 20 mm from the central ray. Radii have
/// noise of 2 % and a common bias of up to 2 %.
SyntheticView synthetic_detections(const phantom::Calibrator& calibrator,
                                   const SyntheticDetectionOptions& options, RandomStream& random);

}  // namespace helicarm::simulation
