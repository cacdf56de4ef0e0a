// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

#include "helicarm/registration/motion.h"

namespace helicarm::registration {

/// A part of the image that is compared with the model: a patch or a piece of contour, linearised at a pose.
struct Comparison {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< its middle
  Information information = Information::Zero();    ///< w J^T J
  Gradient gradient = Gradient::Zero();             ///< w J^T r
  double weight = 0;                                ///< of its agreement in the score
  double agreement = 0;                             ///< 1: as predicted; 0: unrelated; negative: reversed
};

/// One view at a pose.
struct ViewObservation {
  std::vector<Comparison> comparisons;
  double score = 0;        ///< weighted mean agreement, at most 1
  double residual_px = 0;  ///< rms distance of edges from their prediction, weighted robustly
};

/// All views at a pose.
struct Observation {
  std::vector<ViewObservation> views;

  /// Mean over the views; a view that shows nothing of the model counts as 0.
  double score() const {
    double sum = 0;
    for (const ViewObservation& view : views) sum += view.score;
    return views.empty() ? 0 : sum / double(views.size());
  }
};

}  // namespace helicarm::registration
