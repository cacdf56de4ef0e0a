// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/covered.h"

#include <algorithm>
#include <vector>

namespace helicarm::fiducials {
namespace {

/// Whether the disc labelled as `ball` may be that of two fiducials in one: an unlabelled fiducial lies
/// within half its radius; or within its radius, and the other fiducials do not exclude the middle of the
/// two.
bool may_be_two(const LabellingProblem& scene, const Hypothesis& h, int ball) {
  constexpr double excluded_sigmas = 4;
  const auto& own = scene.candidates[h.candidate_of_ball[ball]];
  std::vector<std::size_t> near;
  for (std::size_t other = 0; other < scene.balls.size(); ++other) {
    if (h.candidate_of_ball[other] >= 0) continue;
    const double distance = (h.fit.view.project(scene.balls[other].centre) - own.uv).norm();
    if (distance < 0.5 * own.radius_px) return true;
    if (distance < own.radius_px) near.push_back(other);
  }
  if (near.empty()) return false;
  const Hypothesis others = without(scene, h, ball);
  const Eigen::Vector3d& centre = scene.balls[ball].centre;
  const double sigma = match_sigma_px(scene, others.fit.view, ball, h.candidate_of_ball[ball]);
  const Eigen::Matrix2d spread =
      sigma * sigma * Eigen::Matrix2d::Identity() + prediction_covariance(others.fit, centre);
  return std::ranges::any_of(near, [&](std::size_t other) {
    const Eigen::Vector2d middle =
        (others.fit.view.project(centre) + others.fit.view.project(scene.balls[other].centre)) / 2;
    const Eigen::Vector2d off = own.uv - middle;
    return off.dot(spread.inverse() * off) < excluded_sigmas * excluded_sigmas;
  });
}

}  // namespace

void drop_covered(const LabellingProblem& scene, Hypothesis& h) {
  const Hypothesis full = h;
  for (std::size_t k = 0; k < scene.balls.size(); ++k) {
    const int own = full.candidate_of_ball[k];
    if (own < 0) continue;
    bool uncertain = may_be_two(scene, full, static_cast<int>(k));
    const Eigen::Vector2d uv = h.fit.view.project(scene.balls[k].centre);
    for (std::size_t i = 0; i < scene.candidates.size(); ++i)
      uncertain |= static_cast<int>(i) != own &&
                   (scene.candidates[i].uv - uv).norm() < 5 * match_sigma_px(scene, h.fit.view, k, i);
    if (uncertain) h.candidate_of_ball[k] = -1;
  }
}

}  // namespace helicarm::fiducials
