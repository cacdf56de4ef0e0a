// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/rivals.h"

#include <algorithm>
#include <cmath>

namespace helicarm::fiducials {
namespace {

Hypothesis fitted_in(const Scene& scene, Hypothesis h) {
  h.fit = fit_pose(h.fit.view, correspondences_of(scene, h.candidate_of_ball, h.fit.view), scene.camera,
                   fit_steps);
  evaluate_odds(scene, h);
  return h;
}

double variance_factor(const Hypothesis& h) { return h.fit.chi2 / std::max(1, 2 * h.matched - 6); }

}  // namespace

std::optional<double> fine_margin(const Scene& scene, const Hypothesis& h, const Hypothesis& rival) {
  Scene fine = scene;
  for (BallCandidate& candidate : fine.candidates) {
    if (candidate.own_sigma_px == 0) return std::nullopt;
    candidate.sigma_px = candidate.own_sigma_px;
  }
  const double least = std::min(variance_factor(fitted_in(fine, h)), variance_factor(fitted_in(fine, rival)));
  for (BallCandidate& candidate : fine.candidates) candidate.sigma_px *= std::sqrt(std::max(1.0, least));
  return fitted_in(fine, h).log_odds - fitted_in(fine, rival).log_odds;
}

}  // namespace helicarm::fiducials
