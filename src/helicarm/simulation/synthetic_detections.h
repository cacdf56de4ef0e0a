// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/core/random.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm::simulation {

/// A disc as a detector finds it.
struct SyntheticDetection {
  Eigen::Vector2d uv;  ///< rectified pixels
  double sigma_px;     ///< per axis
  double radius_px;
  double radius_sigma_px;  ///< without the bias common to all
  int ball = -1;           ///< -1: none, or two in one
};

enum class OutlierKind {
  uniform,    ///< anywhere in the field, half of them among the balls
  imitating,  ///< the first a few pixels from where a hidden ball would be, the others strewn
  lattice     ///< on a square lattice, as a plate's dots taken for balls
};

struct SyntheticDetectionOptions {
  int hidden = 0;
  int outliers = 0;
  OutlierKind kind = OutlierKind::uniform;
  double noise_px = 0.5;
  std::optional<bool> mirrored = {};  ///< empty: either
};

/// A calibrator as seen from any side by a C-arm of which only nominal values are known. No pixels are drawn.
struct SyntheticView {
  View view;  ///< world = calibrator; a mirrored image has fx < 0
  std::vector<SyntheticDetection> detections;
  int visible = 0;  ///< balls with a disc of their own
  double radius_bias = 0;

  bool mirrored() const { return view.intrinsics.fx < 0; }
};

/// What the file would say of that C-arm: f true within 1 %, the central point within 55 px.
struct NominalCamera {
  double focal_px = 4345;
  Eigen::Vector2d principal_px{511.5, 511.5};
  double field_radius_px = 504;
};

/// The calibrator's middle lies 550 to 920 mm from the source, up to 20 mm beside the central ray. Radii have
/// noise of 2 % and a common bias up to 2 %.
SyntheticView synthetic_detections(const Calibrator& calibrator, const SyntheticDetectionOptions& options,
                                   RandomStream& random);

}  // namespace helicarm::simulation
