// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/priors.h"
#include "helicarm/fiducials/label.h"

namespace helicarm::phantom_calibration {

/// One X-ray image of the phantom before any fiducial is labelled.
struct PhantomView {
  std::string name;
  std::vector<fiducials::BallCandidate> candidates;  ///< rectified px
  fiducials::LabellingPrior labelling;               ///< of the camera; `mirrored` where it is known
  geometry::IntrinsicsPrior prior;
};

/// Limits in px are those of an image of 1024 px a side; in a view they are so many times as large.
inline double limit_scale(const PhantomView& view) {
  constexpr double usual_field_radius_px = 724;
  return view.labelling.field_radius_px > 0 ? view.labelling.field_radius_px / usual_field_radius_px : 1;
}

/// A phantom and its views as first found, by candidates' centres: to a fraction of a millimetre.
struct Reconstruction {
  std::vector<Eigen::Vector3d> centres;  ///< mm
  std::vector<double> diameters_mm;
  std::vector<std::optional<geometry::View>> views;  ///< nothing: not part of it
  std::vector<std::vector<int>> candidate_of;        ///< per view and fiducial; -1: not seen
  double rms_px = 0;                                 ///< per axis
  bool fixed_centres = false;                        ///< only the views are adjusted
  /// Reconstructed from scratch: rms of the depth-reversed phantom, which affine views show alike.
  std::optional<double> reversed_rms_px = {};
};

}  // namespace helicarm::phantom_calibration
