// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/fiducials/hypothesis.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm {

/// What the file says of the camera, in rectified pixels.
struct LabellingPrior {
  std::optional<double> focal_px;     ///< source distance over pixel size; empty: from 4 to 24 field radii
  double focal_sigma = 0.01;          ///< relative
  Eigen::Vector2d principal_px;       ///< nominal, the image's centre
  double principal_sigma_px = 30;     ///< per axis
  std::optional<bool> mirrored = {};  ///< where it is known
  double field_radius_px;             ///< of the disc in which candidates may lie
  /// Of all candidates' radii, relative. What another view's labelling has found, with a sigma of 0.008,
  /// tells apart the look-alikes of a helix seen along its axis with an end ball hidden.
  double radius_bias = 0;
  double radius_bias_sigma = 0.03;
};

struct LabellingOptions {
  double tolerance_mm =
      0;  ///< of the balls' places, per axis, in addition to what the calibrator's file states
  double systematic_sigma =
      4e-4;                     ///< left by rectification, in field radii, per axis; adds to each candidate's
  double least_log_odds = 9.2;  ///< ln of the odds asked for, against chance and against any other labelling
};

struct Labelling {
  std::vector<int> candidate_of_ball;  ///< -1: not seen
  View view;                           ///< estimate, world = calibrator; a mirrored image has fx < 0
  bool mirrored = false;
  int matched = 0;
  int false_blobs = 0;     ///< candidates that are no ball
  double rms_px = 0;       ///< distance between candidate and projection
  double radius_bias = 0;  ///< found, relative; known to about one per cent
  double log_odds = 0;     ///< against chance
  double margin = 0;       ///< log odds against the best other labelling
  int runner_up_matched = 0;
  double runner_up_rms_px = 0;
};

/// Names the calibrator's balls among the candidates, from any side, with no starting pose, mirrored or not.
/// Refuses with too_few_fiducials (fewer than six balls to be recognised), ambiguous_labels (another
/// labelling, or the mirror image, explains the image almost as well) or calibrator_mismatch (no pose shows
/// these balls here).
Expected<Labelling> label_balls(const Calibrator& calibrator, const std::vector<BallCandidate>& candidates,
                                const LabellingPrior& prior, const LabellingOptions& options = {});

}  // namespace helicarm
