// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/label.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/fiducials/covered.h"
#include "helicarm/fiducials/rivals.h"
#include "helicarm/fiducials/search.h"

namespace helicarm::fiducials {
namespace {

constexpr double chi2_sigmas = 3.3;     // of chi2, in sigmas: exceeded by one correct view in 2000
constexpr std::size_t most_loose = 24;  // poses; for a similar calibrator one of the first is right

Eigen::Vector3d centroid(const phantom::Calibrator& calibrator) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& ball : calibrator.balls) sum += ball.centre_in_calibrator;
  return sum / static_cast<double>(calibrator.balls.size());
}

LabellingProblem scene_of(const phantom::Calibrator& calibrator, const std::vector<BallCandidate>& candidates,
                          const LabellingPrior& prior, const LabellingOptions& options) {
  LabellingProblem scene;
  const Eigen::Vector3d centre = centroid(calibrator);
  const auto covariances = phantom::ball_covariances(calibrator);
  for (std::size_t k = 0; k < calibrator.balls.size(); ++k) {
    const phantom::CalibratorBall& ball = calibrator.balls[k];
    const double stated = covariances.empty() ? 0 : std::sqrt(covariances[k].trace() / 3);
    scene.balls.push_back(
        {ball.centre_in_calibrator - centre, ball.diameter_mm / 2, std::hypot(stated, options.tolerance_mm)});
  }
  scene.candidates = candidates;
  for (auto& candidate : scene.candidates) {
    candidate.sigma_px = std::hypot(candidate.sigma_px, options.systematic_sigma * prior.field_radius_px);
  }
  const double r = prior.field_radius_px;
  scene.camera = {prior.focal_px.value_or(std::sqrt(4.0 * 24.0) * r),
                  prior.focal_px ? prior.focal_sigma : 0.6, prior.principal_px, prior.principal_sigma_px};
  scene.field_radius_px = r;
  scene.radius_bias = prior.radius_bias;
  scene.radius_bias_sigma = prior.radius_bias_sigma;
  scene.mirrored = prior.mirrored;
  scene.expected = prior.expected;
  if (scene.expected) {
    geometry::RigidTransform& pose = scene.expected->view.camera_from_world;
    pose.translation += pose.rotation * centre;
  }
  return scene;
}

std::vector<double> focals_to_try(const LabellingPrior& prior) {
  if (prior.focal_px) return {*prior.focal_px};
  constexpr int steps = 7;
  std::vector<double> focals;
  for (int i = 0; i <= steps; ++i) {
    focals.push_back(4 * prior.field_radius_px * std::pow(6.0, static_cast<double>(i) / steps));
  }
  return focals;
}

bool is_certain(const Hypothesis& h, const LabellingOptions& options) {
  return h.matched >= least_balls && h.log_odds >= options.least_log_odds;
}

int count_labelled(const Hypothesis& h) {
  return static_cast<int>(
      std::count_if(h.candidate_of_ball.begin(), h.candidate_of_ball.end(), [](int i) { return i >= 0; }));
}

/// Removes from `h` each pair that `rival` lacks, if `rival` assigns another candidate to any fiducial.
void keep_agreed(Hypothesis& h, const Hypothesis& rival) {
  const auto& own_labels = h.candidate_of_ball;
  const auto& of_rival = rival.candidate_of_ball;
  bool other = false;
  for (std::size_t k = 0; k < own_labels.size(); ++k)
    other |= of_rival[k] >= 0 && of_rival[k] != own_labels[k];
  for (std::size_t k = 0; other && k < own_labels.size(); ++k)
    if (of_rival[k] != own_labels[k]) h.candidate_of_ball[k] = -1;
}

bool contradicts(const Hypothesis& rival, const Hypothesis& h) {
  Hypothesis agreed = h;
  keep_agreed(agreed, rival);
  return rival.mirrored() != h.mirrored() || count_labelled(agreed) < count_labelled(h);
}

/// The best hypothesis with enlarged errors. It exceeds the best one if the file describes a similar but
/// different calibrator, of which a few fiducials fit by chance.
Hypothesis loose_best(const LabelSearch& search, const LabellingOptions& options) {
  const Hypothesis& best = search.ranking().front();
  LabellingProblem loose = search.scene();
  for (auto& candidate : loose.candidates) {
    candidate.sigma_px = std::hypot(candidate.sigma_px, 0.006 * loose.field_radius_px);
  }
  for (auto& ball : loose.balls) ball.sigma_mm *= 3;  // three times the stated tolerance
  Hypothesis found = match_and_fit(loose, best.fit.view);
  const auto could_match = static_cast<double>(std::min(loose.candidates.size(), loose.balls.size()));
  if (best.matched >= 0.75 * could_match) return found;
  for (const geometry::View& rough : search.supported(best.matched, most_loose)) {
    if (found.log_odds > best.log_odds && is_certain(found, options)) break;
    Hypothesis other = match_and_fit(loose, rough, best.matched);
    if (other.log_odds > found.log_odds) found = std::move(other);
  }
  return found;
}

tl::unexpected<Failure> too_few(int balls, int candidates) {
  return fail(Reason::too_few_fiducials,
              fmt::format("{} fiducials were labelled, at least {} are required", balls, least_balls),
              {{"n", balls}, {"candidates", candidates}, {"needed", least_balls}});
}

/// Factor on the variance: a stated tolerance is uncertain by about 40 %.
double variance_allowance(const LabellingProblem& scene) { return scene.balls.front().sigma_mm > 0 ? 2 : 1; }

/// Whether chi-square exceeds its limit, also without the worst fiducial, which may be an outlier.
bool is_inconsistent(const LabellingProblem& scene, const Hypothesis& h) {
  const double allowance = variance_allowance(scene);
  if (chi2_excess(h.fit.chi2 / allowance, 2 * h.matched - 6) < chi2_sigmas) return false;
  Hypothesis kept = h;
  if (const auto off = outlying(scene, h); !off.empty()) kept = without(scene, h, off.front());
  const int labelled = count_labelled(kept);
  return labelled < std::max(least_balls, h.matched - 1) ||
         chi2_excess(kept.fit.chi2 / allowance, 2 * labelled - 6) > chi2_sigmas;
}

/// The reason to refuse the best hypothesis, if any.
std::optional<Failure> refusal_of(const LabelSearch& search, const LabellingOptions& options) {
  const LabellingProblem& scene = search.scene();
  const Ranking& ranking = search.ranking();
  const int n = static_cast<int>(scene.candidates.size());
  if (ranking.empty() || ranking.front().log_odds <= 0) {
    if (n < least_balls + 2) return too_few(ranking.empty() ? 0 : ranking.front().matched, n).value();
    return fail(Reason::calibrator_mismatch,
                fmt::format("no pose of the calibrator explains the {} candidates in the image", n),
                {{"candidates", n}, {"matched", ranking.empty() ? 0 : ranking.front().matched}})
        .value();
  }
  const Hypothesis& best = ranking.front();
  const int dof = 2 * best.matched - 6;
  const Hypothesis loose = loose_best(search, options);
  if ((loose.log_odds > best.log_odds && loose.matched >= least_balls) || is_inconsistent(scene, best)) {
    return fail(Reason::calibrator_mismatch,
                fmt::format("the fiducials deviate from the calibrator's coordinates by {:.2f} px rms: check "
                            "the calibrator's file, pixel size and source distance",
                            std::sqrt(loose.residual2_px2 / loose.matched)),
                {{"matched", best.matched},
                 {"chi2", best.fit.chi2},
                 {"dof", dof},
                 {"log_odds", best.log_odds},
                 {"matched_loosely", loose.matched},
                 {"log_odds_loosely", loose.log_odds}})
        .value();
  }
  if (best.matched < least_balls) return too_few(best.matched, n).value();
  if (best.log_odds < options.least_log_odds) {
    return fail(Reason::ambiguous_labels,
                fmt::format("{} of {} candidates fit the calibrator, with log odds of {:.1f} against chance, "
                            "limit {:g}",
                            best.matched, n, best.log_odds, options.least_log_odds),
                {{"matched", best.matched},
                 {"log_odds", best.log_odds},
                 {"log_odds_needed", options.least_log_odds}})
        .value();
  }
  return std::nullopt;
}

/// Rivals within this multiple of the required log odds are also compared by the candidates' own errors: one
/// more fiducial that fits badly may outweigh a rival that fits well.
constexpr double comparison_width = 3;

/// The best hypothesis, or a rival almost as good that contradicts it and is better by the candidates' own
/// errors.
Hypothesis best_by_own_errors(const LabelSearch& search, const LabellingOptions& options) {
  const Hypothesis* best = &search.ranking().front();
  for (const Hypothesis& rival : search.ranking()) {
    if (search.ranking().front().log_odds - rival.log_odds >= comparison_width * options.least_log_odds)
      break;
    if (rival.matched < least_balls || !contradicts(rival, *best)) continue;
    if (fine_margin(search.scene(), rival, *best).value_or(0) >= options.least_log_odds) best = &rival;
  }
  return *best;
}

/// Whether `rival` labels more fiducials and is almost as good if the source distance is wrong, for which the
/// prior odds are 1 to 1000: then labels of a helix shifted by one, which keep the handedness, may fit better
/// than the true ones.
bool fits_another_distance(const LabellingProblem& scene, const Hypothesis& h, const Hypothesis& rival,
                           double required) {
  constexpr double wrong_focal_sigma = 0.1;  // relative
  constexpr double wrong_log_odds = -6.9;
  if (rival.matched <= h.matched || rival.mirrored() != h.mirrored()) return false;
  LabellingProblem wrong = scene;
  wrong.camera.focal_sigma = std::max(wrong_focal_sigma, scene.camera.focal_sigma);
  return refitted(wrong, rival).log_odds + wrong_log_odds > h.log_odds - required;
}

/// Whether `h` does not exceed `rival` by the required log odds.
bool is_close(const LabellingProblem& scene, const Hypothesis& h, const Hypothesis& rival, double required) {
  if (fits_another_distance(scene, h, rival, required)) return true;
  const double margin = h.log_odds - rival.log_odds;
  if (margin >= comparison_width * required) return false;
  const auto fine = fine_margin(scene, h, rival);
  if (!fine) return margin < required;
  return *fine < (margin < required ? required : 0);
}

/// The best hypothesis without outlying fiducials and without labels that a rival almost as good contradicts.
/// Refused if fewer than six labels remain.
Expected<Hypothesis> unambiguous(LabelSearch& search, const LabellingOptions& options) {
  const LabellingProblem& scene = search.scene();
  Hypothesis best = best_by_own_errors(search, options);
  const int dof = 2 * best.matched - 6;
  // If chi2 exceeds its expectation by over 1.5 sigma, the required odds grow in proportion.
  const double required =
      options.least_log_odds * std::max(1.0, best.fit.chi2 / (dof + 1.5 * std::sqrt(2.0 * dof)));
  const int matched = best.matched;
  const int n = static_cast<int>(scene.candidates.size());
  // All outlying fiducials are removed, since the farthest is not always the outlier; then other candidates
  // near them are tried.
  for (auto off = outlying(scene, best); !off.empty(); off = outlying(scene, best)) {
    for (const int ball : off) best = without(scene, std::move(best), ball);
    if (count_labelled(best) < least_balls) return too_few(count_labelled(best), n);
    evaluate_odds(scene, best);
    search.try_near_misses(best);
  }
  const Hypothesis full = best;
  drop_covered(scene, best);
  if (count_labelled(best) < least_balls) return too_few(count_labelled(best), n);
  for (const auto& rival : search.ranking()) {
    if (!contradicts(rival, best) || !is_close(scene, full, rival, required)) continue;
    if (rival.mirrored() == best.mirrored()) keep_agreed(best, rival);
    if (rival.mirrored() != best.mirrored() || count_labelled(best) < least_balls) {
      return fail(Reason::ambiguous_labels,
                  fmt::format("another labelling explains the image almost as well: log odds {:.1f} apart, "
                              "at least {:.1f} are required",
                              full.log_odds - rival.log_odds, required),
                  {{"matched", matched},
                   {"runner_up_matched", rival.matched},
                   {"mirror_differs", rival.mirrored() != best.mirrored()},
                   {"margin", full.log_odds - rival.log_odds},
                   {"margin_needed", required}});
    }
  }
  best.fit = fit_pose(best.fit.view, correspondences_of(scene, best.candidate_of_ball, best.fit.view),
                      scene.camera, fit_steps);
  return best;
}

Labelling labelling_of(const LabelSearch& search, const Hypothesis& best,
                       const phantom::Calibrator& calibrator, const LabellingPrior& prior) {
  Labelling labelling;
  labelling.candidate_of_ball = best.candidate_of_ball;
  labelling.view = best.fit.view;
  labelling.view.camera_from_world.translation -=
      best.fit.view.camera_from_world.rotation * centroid(calibrator);
  labelling.mirrored = best.mirrored();
  labelling.matched = count_labelled(best);
  labelling.false_blobs = static_cast<int>(search.scene().candidates.size()) - best.matched;
  labelling.rms_px = std::sqrt(best.residual2_px2 / best.matched);
  labelling.radius_bias = (1 + prior.radius_bias) * std::exp(best.radius_excess) - 1;
  labelling.log_odds = best.log_odds;
  labelling.margin = best.log_odds;
  for (const auto& rival : search.ranking()) {
    if (!contradicts(rival, best)) continue;
    labelling.margin = best.log_odds - std::max(0.0, rival.log_odds);
    labelling.runner_up_matched = rival.matched;
    labelling.runner_up_rms_px = std::sqrt(rival.residual2_px2 / rival.matched);
    break;
  }
  return labelling;
}

}  // namespace

LabellingAttempt attempt_labels(const phantom::Calibrator& calibrator,
                                const std::vector<BallCandidate>& candidates, const LabellingPrior& prior,
                                const LabellingOptions& options) {
  if (calibrator.balls.size() > most_labelled_balls)
    return {
        {},
        Failure{Reason::unsupported,
                fmt::format(
                    "the calibrator has {} balls, labels are found of up to {}: state those of a part of it",
                    calibrator.balls.size(), most_labelled_balls),
                {},
                {{"balls", double(calibrator.balls.size())}, {"limit", double(most_labelled_balls)}}}};
  constexpr int least_shown = 4;
  const int n = static_cast<int>(candidates.size());
  if (n < least_shown) return {{}, too_few(n, n).value()};
  const LabellingProblem scene = scene_of(calibrator, candidates, prior, options);
  LabelSearch search(scene, focals_to_try(prior));
  search.try_expected();
  // By then, a labelling with one fiducial less would have been found, too.
  try_random_triples(
      search, triples_required(least_balls, candidates.size()), [&](const Hypothesis& h, std::size_t tried) {
        return is_certain(h, options) &&
               tried >= triples_required(std::max(least_balls, h.matched - 1), candidates.size());
      });
  if (!search.ranking().empty()) search_rivals(search);
  LabellingAttempt attempt;
  attempt.failure = n < least_balls ? too_few(n, n).value() : refusal_of(search, options);
  auto best =
      attempt.failure ? Expected<Hypothesis>(tl::unexpect, *attempt.failure) : unambiguous(search, options);
  if (!best) {
    attempt.failure = best.error();
    if (!search.ranking().empty() && search.ranking().front().matched >= least_shown)
      attempt.best = labelling_of(search, search.ranking().front(), calibrator, prior);
    return attempt;
  }
  attempt.best = labelling_of(search, *best, calibrator, prior);
  return attempt;
}

Expected<Labelling> label_balls(const phantom::Calibrator& calibrator,
                                const std::vector<BallCandidate>& candidates, const LabellingPrior& prior,
                                const LabellingOptions& options) {
  if (const int n = static_cast<int>(candidates.size()); n < least_balls) return too_few(n, n);
  LabellingAttempt attempt = attempt_labels(calibrator, candidates, prior, options);
  if (attempt.failure) return tl::unexpected<Failure>(*std::move(attempt.failure));
  return *std::move(attempt.best);
}

}  // namespace helicarm::fiducials
