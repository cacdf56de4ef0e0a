// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/rivals.h"

#include <algorithm>
#include <cmath>

namespace helicarm::fiducials {
namespace {

double variance_factor(const Hypothesis& h) { return h.fit.chi2 / std::max(1, 2 * h.matched - 6); }

}  // namespace

Hypothesis refitted(const LabellingProblem& scene, Hypothesis h) {
  h.fit = fit_pose(h.fit.view, correspondences_of(scene, h.candidate_of_ball, h.fit.view), scene.camera,
                   fit_steps);
  evaluate_odds(scene, h);
  return h;
}

std::optional<double> fine_margin(const LabellingProblem& scene, const Hypothesis& h,
                                  const Hypothesis& rival) {
  LabellingProblem fine = scene;
  for (BallCandidate& candidate : fine.candidates) {
    if (candidate.own_sigma_px == 0) return std::nullopt;
    candidate.sigma_px = candidate.own_sigma_px;
  }
  const double least = std::min(variance_factor(refitted(fine, h)), variance_factor(refitted(fine, rival)));
  for (BallCandidate& candidate : fine.candidates) candidate.sigma_px *= std::sqrt(std::max(1.0, least));
  return refitted(fine, h).log_odds - refitted(fine, rival).log_odds;
}

}  // namespace helicarm::fiducials
