// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "helicarm/track/marker_image.h"

namespace helicarm::track {

/// Learns how the contrast of the markers in one view depends on the grey level around them: a marker takes a
/// share of the primary radiation, and none of the scatter (or, in a logarithmic image, adds the same
/// everywhere).
class ContrastLearner {
 public:
  /// The contrast that the images so far make likely for a marker.
  ContrastModel model() const;
  void forget();
  /// `ratio`: of this marker's contrast to the others'.
  void add(const MarkerImage& image, double ratio);

 private:
  // Of a line through contrast over background.
  Eigen::Matrix2d normal_ = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right_ = Eigen::Vector2d::Zero();
  double squares_ = 0, count_ = 0;  // of relative deviations from it
};

/// Relative standard deviation of a fitted contrast: that of a blurred disc's height beside that of its
/// centre.
inline double contrast_sigma(const MarkerImage& image) {
  return 1.5 * image.sigma_px / std::max(0.5, image.radius_px);
}

}  // namespace helicarm::track
