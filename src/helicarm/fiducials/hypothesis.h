// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "helicarm/fiducials/pose_fit.h"

namespace helicarm::fiducials {

/// A dot that may be a fiducial.
struct BallCandidate {
  Eigen::Vector2d uv;  ///< rectified pixels
  double sigma_px;     ///< per axis
  double radius_px;
  double radius_sigma_px;  ///< without the common bias
  /// Per axis, with the distortion map's standard deviation at this position; 0: not known.
  double own_sigma_px = 0;
};

struct ModelBall {
  Eigen::Vector3d centre;  ///< mm, from the calibrator's centroid
  double radius_mm;
  double sigma_mm = 0;  ///< of the centre, per axis
};

/// A camera known before the image is labelled, as from neighbouring images of a run.
struct ExpectedView {
  geometry::View view;
  double within_deg;  ///< a camera turned from it by more is impossible

  bool allows(const geometry::View& other) const;
};

/// One image's input to the labelling.
struct LabellingProblem {
  std::vector<ModelBall> balls;
  std::vector<BallCandidate> candidates;  ///< sigma_px with its lower limit
  CameraPrior camera;
  double field_radius_px;  ///< of the disc where outliers may lie
  double radius_bias;      ///< of all measured radii, relative
  double radius_bias_sigma;
  std::optional<bool> mirrored = {};  ///< if known, only this handedness is tried
  std::optional<ExpectedView> expected = {};
};

/// Possible mm per px at a candidate if it is a given ball, by its radius.
struct Scale {
  double finest;
  double coarsest;

  bool holds(double mm_per_px) const { return finest <= mm_per_px && mm_per_px <= coarsest; }
};
Scale scale_by_radius(const LabellingProblem& scene, const BallCandidate& candidate, const ModelBall& ball,
                      double sigmas);

/// A pose and the candidate assigned to each ball (-1: none).
struct Hypothesis {
  std::vector<int> candidate_of_ball;
  int matched = 0;
  PoseFit fit;
  double residual2_px2 = 0;  ///< sum of squared distances
  double radius_excess = 0;  ///< weighted mean of ln(measured / expected radius at the ball's distance)
  /// Logarithm of the odds of these matches against chance. For candidates uniform over the field, the odds
  /// summed over all hypotheses have expectation 1; by Markov's inequality the sum exceeds e^x with a
  /// probability below e^-x.
  double log_odds = 0;

  bool mirrored() const { return fit.view.intrinsics.fx < 0; }
};

/// Pairs balls and candidates one to one, nearest first, within `gate_px` and at a distance from the source
/// that agrees with the candidate's radius.
std::vector<int> match(const LabellingProblem& scene, const geometry::View& view, double gate_px);

constexpr int fit_steps = 10;  ///< at most

/// Per axis, px: the candidate's error and that of the ball's coordinates, projected.
double match_sigma_px(const LabellingProblem& scene, const geometry::View& view, std::size_t ball,
                      std::size_t candidate);

/// The matched balls as input of `fit_pose` near `view`.
std::vector<WeightedCorrespondence> correspondences_of(const LabellingProblem& scene,
                                                       const std::vector<int>& candidate_of_ball,
                                                       const geometry::View& view);

/// Largest error of a pose from three points at the other balls.
inline double rough_gate_px(const LabellingProblem& scene) { return 0.025 * scene.field_radius_px; }

/// Alternates matching, with narrowing gates, and fitting from a rough pose until the matches are stable.
/// With fewer than `least` matches, log_odds = -infinity.
Hypothesis match_and_fit(const LabellingProblem& scene, const geometry::View& rough, int least = 4);

/// Sets the number of matches, residuals and log odds from the matches and the fit.
void evaluate_odds(const LabellingProblem& scene, Hypothesis& h);

/// The balls over 3.3 sigma (candidate and prediction) from their positions predicted by the others, the
/// farthest first: one true ball of 230.
std::vector<int> outlying(const LabellingProblem& scene, const Hypothesis& h);

/// `h` without a ball, fitted again; the odds are not updated.
Hypothesis without(const LabellingProblem& scene, Hypothesis h, int ball);

/// Variants of `h` with this pair: with all others, and without each that is then outlying, and those that
/// still are after its removal.
std::vector<Hypothesis> with_pair(const LabellingProblem& scene, const Hypothesis& h, int ball,
                                  int candidate);

}  // namespace helicarm::fiducials
