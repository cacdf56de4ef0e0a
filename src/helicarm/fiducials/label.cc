// SPDX-License-Identifier: Apache-2.0
#include "helicarm/fiducials/label.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "helicarm/core/random.h"
#include "helicarm/fiducials/search.h"

namespace helicarm {
namespace {

constexpr int least_balls = 6;
constexpr std::size_t most_triples = 400;  // six balls among ten false blobs escape with a chance below 1e-6
constexpr std::size_t loose_triples = 60;
constexpr int challenges = 8;              // triples of the best hypothesis on which rivals are sought

using Triple = std::array<int, 3>;

Eigen::Vector3d centroid(const Calibrator& calibrator) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& ball : calibrator.balls) sum += ball.centre_in_calibrator;
  return sum / static_cast<double>(calibrator.balls.size());
}

Scene scene_of(const Calibrator& calibrator, const std::vector<BallCandidate>& candidates, const LabellingPrior& prior,
               const LabellingOptions& options) {
  Scene scene;
  const Eigen::Vector3d centre = centroid(calibrator);
  for (const auto& ball : calibrator.balls) {
    scene.balls.push_back({ball.centre_in_calibrator - centre, ball.diameter_mm / 2});
  }
  scene.candidates = candidates;
  for (auto& candidate : scene.candidates) {
    candidate.sigma_px = std::hypot(candidate.sigma_px, options.systematic_sigma * prior.field_radius_px);
  }
  const double r = prior.field_radius_px;
  scene.camera = {prior.focal_px.value_or(std::sqrt(4.0 * 24.0) * r), prior.focal_px ? prior.focal_sigma : 0.6,
                  prior.principal_px, prior.principal_sigma_px};
  scene.field_radius_px = r;
  scene.radius_bias = prior.radius_bias;
  scene.radius_bias_sigma = prior.radius_bias_sigma;
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

template <class T>
void shuffle(std::vector<T>& items, RandomStream& random) {
  for (std::size_t i = items.size(); i > 1; --i) std::swap(items[i - 1], items[random.index(static_cast<std::uint32_t>(i))]);
}

/// Every candidate in turn, in random company, so that no candidate is left out for long.
class TripleDealer {
 public:
  explicit TripleDealer(std::vector<int> items) : items_(std::move(items)), next_(items_.size()) {}

  Triple deal() {
    if (next_ + 3 > items_.size()) {
      shuffle(items_, random_);
      next_ = 0;
    }
    next_ += 3;
    return {items_[next_ - 3], items_[next_ - 2], items_[next_ - 1]};
  }

 private:
  std::vector<int> items_;
  std::size_t next_;
  RandomStream random_{1, 0};
};

bool recognised(const Ranking& ranking, const LabellingOptions& options) {
  return !ranking.empty() && ranking.front().matched >= least_balls &&
         ranking.front().log_odds >= options.least_log_odds;
}

void explore(LabelSearch& search, std::size_t candidates, std::size_t triples, const LabellingOptions& options) {
  std::vector<int> all(candidates);
  std::iota(all.begin(), all.end(), 0);
  TripleDealer dealer(all);
  for (std::size_t i = 0; i < triples && !recognised(search.ranking(), options); ++i) {
    search.try_triple(dealer.deal());
  }
}

/// A rival within reach of the best shares all but one or two of its candidates, so it holds several of the disjoint
/// triples dealt from these.
void challenge(LabelSearch& search) {
  std::vector<int> best;
  do {
    best = search.ranking().front().candidate_of_ball;
    std::vector<int> seen;
    std::copy_if(best.begin(), best.end(), std::back_inserter(seen), [](int i) { return i >= 0; });
    TripleDealer dealer(seen);
    for (int done = 0, dealt = 0; done < challenges && dealt < 5 * challenges; ++dealt) {
      done += search.try_triple(dealer.deal()) ? 1 : 0;
    }
  } while (search.ranking().front().candidate_of_ball != best);
}

/// A ball whose disc another, unnamed ball covers, or one with two candidates in reach, is better left unnamed.
void drop_doubtful(const Scene& scene, Hypothesis& h) {
  const std::vector<int> named = h.candidate_of_ball;
  for (std::size_t k = 0; k < named.size(); ++k) {
    if (named[k] < 0) continue;
    const auto& own = scene.candidates[named[k]];
    bool doubtful = false;
    for (std::size_t other = 0; other < named.size(); ++other) {
      if (named[other] >= 0) continue;
      const Eigen::Vector2d uv = h.fit.view.project(scene.balls[other].centre);
      doubtful |= (uv - own.uv).norm() < 0.5 * own.radius_px;
    }
    const Eigen::Vector2d uv = h.fit.view.project(scene.balls[k].centre);
    for (std::size_t i = 0; i < scene.candidates.size(); ++i) {
      const auto& other = scene.candidates[i];
      doubtful |= static_cast<int>(i) != named[k] && (other.uv - uv).norm() < 5 * other.sigma_px;
    }
    if (doubtful) h.candidate_of_ball[k] = -1;
  }
}

/// Takes out of `h` each pair that `rival` contradicts; how many are left.
int keep_agreed(Hypothesis& h, const Hypothesis& rival) {
  int left = 0;
  for (std::size_t k = 0; k < h.candidate_of_ball.size(); ++k) {
    int& mine = h.candidate_of_ball[k];
    if (mine < 0) continue;
    for (std::size_t j = 0; j < rival.candidate_of_ball.size(); ++j) {
      const bool same_ball = j == k;
      if (same_ball ? rival.candidate_of_ball[j] >= 0 && rival.candidate_of_ball[j] != mine
                    : rival.candidate_of_ball[j] == mine) {
        mine = -1;
        break;
      }
    }
    left += mine >= 0 ? 1 : 0;
  }
  return left;
}

bool contradicts(const Hypothesis& rival, const Hypothesis& h) {
  Hypothesis agreed = h;
  const auto named = std::count_if(h.candidate_of_ball.begin(), h.candidate_of_ball.end(), [](int i) { return i >= 0; });
  return rival.mirrored() != h.mirrored() || keep_agreed(agreed, rival) < named;
}

/// Chi-square over its degrees of freedom as a standard normal deviate (Wilson and Hilferty 1931).
double deviate(double chi2, int dof) {
  const double spread = 2.0 / (9 * dof);
  return (std::cbrt(chi2 / dof) - (1 - spread)) / std::sqrt(spread);
}

/// Log odds of the calibrator with its balls well off their places: above those of `best` when the file is of a
/// similar but different calibrator, of which some balls happen to fit.
double loose_log_odds(const Scene& scene, const Hypothesis& best, const LabellingPrior& prior,
                      const LabellingOptions& options) {
  Scene loose = scene;
  for (auto& candidate : loose.candidates) candidate.sigma_px = std::hypot(candidate.sigma_px, 0.006 * scene.field_radius_px);
  const double near_best = settle(loose, best.fit.view).log_odds;
  const auto unnamed = std::min(scene.candidates.size(), scene.balls.size()) - static_cast<std::size_t>(best.matched);
  if (unnamed < 2 || near_best > best.log_odds) return near_best;
  LabelSearch search(loose, focals_to_try(prior));
  explore(search, loose.candidates.size(), loose_triples, options);
  return search.ranking().empty() ? near_best : std::max(near_best, search.ranking().front().log_odds);
}

tl::unexpected<Failure> unexplained(const Scene& scene, const Ranking& ranking, const LabellingOptions& options) {
  const int n = static_cast<int>(scene.candidates.size());
  const int matched = ranking.empty() ? 0 : ranking.front().matched;
  const double odds = ranking.empty() ? -std::numeric_limits<double>::infinity() : ranking.front().log_odds;
  if (odds >= options.least_log_odds || n < least_balls + 2) {
    const int seen = odds >= options.least_log_odds ? matched : n;
    return fail(Reason::too_few_fiducials,
                fmt::format("only {} balls of the calibrator could be recognised; {} are needed", std::min(seen, matched), least_balls),
                {{"n", std::min(seen, matched)}, {"candidates", n}, {"needed", least_balls}});
  }
  return fail(Reason::calibrator_mismatch,
              fmt::format("no pose of the calibrator explains the {} discs found in the image", n),
              {{"candidates", n}, {"best_matched", matched}});
}

}  // namespace

Expected<Labelling> label_balls(const Calibrator& calibrator, const std::vector<BallCandidate>& candidates,
                                const LabellingPrior& prior, const LabellingOptions& options) {
  const int n = static_cast<int>(candidates.size());
  if (n < least_balls) {
    return fail(Reason::too_few_fiducials, fmt::format("only {} balls were found; {} are needed", n, least_balls),
                {{"n", n}, {"candidates", n}, {"needed", least_balls}});
  }
  const Scene scene = scene_of(calibrator, candidates, prior, options);
  LabelSearch search(scene, focals_to_try(prior));
  explore(search, candidates.size(), most_triples, options);
  if (!recognised(search.ranking(), options)) return unexplained(scene, search.ranking(), options);
  challenge(search);

  Hypothesis best = search.ranking().front();
  const int dof = 2 * best.matched - 6;
  const double loose = loose_log_odds(scene, best, prior, options);
  if (loose > best.log_odds || deviate(best.fit.chi2, dof) > 4.5) {
    return fail(Reason::calibrator_mismatch,
                fmt::format("the balls lie near the calibrator's places but not at them ({:.2f} px)",
                            std::sqrt(best.residual2_px2 / best.matched)),
                {{"matched", best.matched}, {"chi2", best.fit.chi2}, {"dof", dof},
                 {"log_odds", best.log_odds}, {"log_odds_loose", loose}});
  }

  drop_doubtful(scene, best);
  const double asked = options.least_log_odds * std::max(1.0, best.fit.chi2 / (dof + 3 * std::sqrt(2.0 * dof)));
  int left = keep_agreed(best, best);
  for (const auto& rival : search.ranking()) {
    if (best.log_odds - rival.log_odds >= asked) break;
    left = rival.mirrored() == best.mirrored() ? keep_agreed(best, rival) : 0;
    if (left < least_balls) {
      return fail(Reason::ambiguous_labels, "another labelling explains the image almost as well",
                  {{"matched", best.matched}, {"runner_up_matched", rival.matched},
                   {"mirror_differs", rival.mirrored() != best.mirrored()},
                   {"margin", best.log_odds - rival.log_odds}, {"margin_needed", asked}});
    }
  }

  Labelling labelling;
  labelling.candidate_of_ball = best.candidate_of_ball;
  labelling.view = best.fit.view;
  labelling.view.camera_from_world.translation -= best.fit.view.camera_from_world.rotation * centroid(calibrator);
  labelling.mirrored = best.mirrored();
  labelling.matched = left;
  labelling.false_blobs = n - best.matched;
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

}  // namespace helicarm
