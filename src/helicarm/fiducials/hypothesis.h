// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "helicarm/fiducials/pose_fit.h"

namespace helicarm {

/// A dark disc that may be a calibrator ball.
struct BallCandidate {
  Eigen::Vector2d uv;  ///< rectified pixels
  double sigma_px;     ///< per axis
  double radius_px;
  double radius_sigma_px;  ///< without the bias common to all
  /// Per axis, with what the distortion map is known to leave at this place; 0: only the general figure is
  /// known.
  double own_sigma_px = 0;
};

struct ModelBall {
  Eigen::Vector3d centre;  ///< mm, from the calibrator's centroid
  double radius_mm;
  double sigma_mm = 0;  ///< of the centre, per axis
};

/// One X-ray as the labelling sees it.
struct Scene {
  std::vector<ModelBall> balls;
  std::vector<BallCandidate> candidates;  ///< sigma_px floored
  CameraPrior camera;
  double field_radius_px;  ///< of the disc where false blobs may lie
  double radius_bias;      ///< of all radii found, relative
  double radius_bias_sigma;
  std::optional<bool> mirrored = {};  ///< the only handedness that is tried, where it is known
};

/// Millimetres that a pixel may span at a candidate, if it is this ball, judged by its radius.
struct Scale {
  double finest;
  double coarsest;

  bool holds(double mm_per_px) const { return finest <= mm_per_px && mm_per_px <= coarsest; }
};
Scale scale_by_radius(const Scene& scene, const BallCandidate& candidate, const ModelBall& ball,
                      double sigmas);

/// A pose and the candidate each ball has under it (-1: none).
struct Hypothesis {
  std::vector<int> candidate_of_ball;
  int matched = 0;
  PoseFit fit;
  double residual2_px2 = 0;  ///< sum of squared distances
  double radius_excess = 0;  ///< weighted mean of ln(radius found / radius expected at the ball's distance)
  /// Logarithm of the odds that these matches are the calibrator and not chance. With all candidates strewn
  /// evenly over the field, the odds summed over every hypothesis have expectation 1, so by Markov's
  /// inequality a sum above e^x comes by accident with a probability below e^-x.
  double log_odds = 0;

  bool mirrored() const { return fit.view.intrinsics.fx < 0; }
};

/// Pairs balls and candidates one to one, nearest first, when within `gate_px` of each other and at a
/// distance from the source that fits the candidate's radius.
std::vector<int> match(const Scene& scene, const View& view, double gate_px);

constexpr int fit_steps = 10;  ///< at most

/// Per axis, px: the candidate's own error and that of the ball's place in the file, seen at the calibrator's
/// distance.
double match_sigma_px(const Scene& scene, const View& view, std::size_t ball, std::size_t candidate);

/// The matched balls, as a fit near `view` wants them.
std::vector<WeightedCorrespondence> correspondences_of(const Scene& scene,
                                                       const std::vector<int>& candidate_of_ball,
                                                       const View& view);

/// How far a pose from three points may err at the others.
inline double rough_gate_px(const Scene& scene) { return 0.025 * scene.field_radius_px; }

/// Matches and fits in turn with narrowing gates until the matches stand still, from a rough pose. Once it
/// has fewer than `least` matches it is worth nothing: log_odds = -infinity.
Hypothesis settle(const Scene& scene, const View& rough, int least = 4);

/// Sets what follows from the matches and the fit: their number, residuals and log odds.
void weigh(const Scene& scene, Hypothesis& h);

/// The balls that lie off where the others put them, by 3.3 sigma of their candidates and of the prediction:
/// one true ball of 230, and each false disc that anyone could tell from a ball (4 sigma, less what the
/// systematic error adds). The farthest comes first.
std::vector<int> inflated(const Scene& scene, const Hypothesis& h);

/// `h` without a ball, fitted anew but not weighed.
Hypothesis without(const Scene& scene, Hypothesis h, int ball);

/// What becomes of `h` when this candidate is that ball after all: with all the others, and without each that
/// this puts in doubt and those that are then still in doubt.
std::vector<Hypothesis> with_pair(const Scene& scene, const Hypothesis& h, int ball, int candidate);

}  // namespace helicarm
