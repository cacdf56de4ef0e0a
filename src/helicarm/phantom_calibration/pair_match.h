// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

namespace helicarm::phantom_calibration {

/// A candidate as a matcher sees it: px from the principal point, not mirrored, and which kind of ball (by
/// its radius).
struct PlainCandidate {
  Eigen::Vector2d uv;
  int kind;
};

/// Affine epipolar geometry of two views and the candidates it pairs: with the rotation axis between the
/// views along angle_a in the first image and angle_b in the second, coordinates along it are preserved,
/// q = scale p + offset.
struct PairHypothesis {
  double angle_a = 0;  ///< rad
  double angle_b = 0;
  double scale = 1;
  double offset = 0;
  std::vector<std::pair<int, int>> matches;
  double rms_px = 0;
};

/// The hypotheses that pair most candidates (then the most exactly), at most `most`, of views up to about 40
/// degrees apart that are not rolled by more. Exhaustive over both angles and the scale; the offset by a
/// vote. The tolerances are `limit_scale` times those of images of 1024 px a side.
std::vector<PairHypothesis> match_pair(const std::vector<PlainCandidate>& a,
                                       const std::vector<PlainCandidate>& b, std::size_t most,
                                       double limit_scale = 1);

}  // namespace helicarm::phantom_calibration
