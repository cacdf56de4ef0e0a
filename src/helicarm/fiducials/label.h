// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/fiducials/hypothesis.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"

namespace helicarm::fiducials {

/// The camera prior from the image file, in rectified pixels.
struct LabellingPrior {
  std::optional<double> focal_px;     ///< source distance over pixel size; empty: from 4 to 24 field radii
  double focal_sigma = 0.01;          ///< relative
  Eigen::Vector2d principal_px;       ///< nominal, the image's centre
  double principal_sigma_px = 30;     ///< per axis
  std::optional<bool> mirrored = {};  ///< if known
  double field_radius_px;             ///< of the disc in which candidates may lie
  /// Relative bias of all candidates' radii. The value from another view (sigma 0.008) resolves the labels of
  /// a helix seen along its axis with an end fiducial hidden.
  double radius_bias = 0;
  double radius_bias_sigma = 0.03;
  std::optional<ExpectedView> expected = {};  ///< world = calibrator
};

struct LabellingOptions {
  double tolerance_mm = 0;         ///< of the fiducials' coordinates per axis, beyond the file's
  double systematic_sigma = 4e-4;  ///< of rectification, in field radii per axis; added to each candidate's
  double least_log_odds = 9.2;     ///< required, against chance and against any other labelling
};

struct Labelling {
  std::vector<int> candidate_of_ball;  ///< -1: none
  geometry::View view;                 ///< estimate, world = calibrator; a mirrored image has fx < 0
  bool mirrored = false;
  int matched = 0;
  int false_blobs = 0;     ///< candidates without a label
  double rms_px = 0;       ///< distance between candidate and projection
  double radius_bias = 0;  ///< estimated, relative; sigma about 1 %
  double log_odds = 0;     ///< against chance
  double margin = 0;       ///< log odds over the best other labelling
  int runner_up_matched = 0;
  double runner_up_rms_px = 0;
};

/// The best labelling, also where it is refused, and why it is.
struct LabellingAttempt {
  std::optional<Labelling> best;  ///< nothing if no pose explains four candidates
  std::optional<Failure> failure;
};

/// Memory and time grow with the cube of the calibrator's balls.
inline constexpr std::size_t most_labelled_balls = 200;

/// As `label_balls`, with the best guess after a refusal: to be shown, never to be used.
LabellingAttempt attempt_labels(const phantom::Calibrator& calibrator,
                                const std::vector<BallCandidate>& candidates, const LabellingPrior& prior,
                                const LabellingOptions& options = {});

/// Labels the fiducials among the candidates, in any orientation, without a starting pose, mirrored or not.
/// Refuses too_few_fiducials (fewer than six are labelled), ambiguous_labels (another labelling, or the
/// mirror image, explains the image almost as well) or calibrator_mismatch (no pose explains the candidates);
/// unsupported above `most_labelled_balls`.
Expected<Labelling> label_balls(const phantom::Calibrator& calibrator,
                                const std::vector<BallCandidate>& candidates, const LabellingPrior& prior,
                                const LabellingOptions& options = {});

}  // namespace helicarm::fiducials
