// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "helicarm/phantom_calibration/phantom_view.h"
#include "helicarm/pipeline/stages.h"

namespace helicarm::phantom_calibration {

/// A view's candidates for balls of these diameters (all sizes where the pixel's is not known), the clearest
/// first, and what is known of its camera. `dots` has the dot of each candidate.
struct PreparedView {
  PhantomView view;
  std::vector<detection::Dot> dots;
};
PreparedView prepared(const pipeline::RectifiedView& detected, const std::vector<double>& diameters_mm,
                      std::optional<bool> mirrored);

/// The image of a fiducial's centre, measured in the pixels.
struct Observed {
  Eigen::Vector2d uv_raw;
  Eigen::Vector2d uv;     ///< rectified
  double sigma_px;        ///< per axis, without the map's error
  double diameter_mm;     ///< as seen, at the fiducial's depth, less its mean error
  double diameter_sigma;  ///< relative, common to all fiducials (`pipeline::diameter_error`)
};

/// Fits every fiducial's image with the appearance of this image's balls: at its candidate, or where the pose
/// puts it. Nothing for one that is not seen or overlaps another.
std::vector<std::optional<Observed>> observe(const pipeline::RectifiedView& detected,
                                             const PreparedView& prepared, const geometry::View& pose,
                                             const std::vector<Eigen::Vector3d>& centres,
                                             const std::vector<double>& diameters_mm,
                                             const std::vector<int>& candidate_of);

}  // namespace helicarm::phantom_calibration
