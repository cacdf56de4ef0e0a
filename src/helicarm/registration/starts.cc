// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/starts.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "helicarm/core/parallel.h"

namespace helicarm::registration {
namespace {

using geometry::RigidTransform;

/// The additive recurrence with the generalised golden ratio of six dimensions (Roberts 2018), in -1 .. 1.
RigidStep sequence(int number) {
  constexpr double ratio = 1.1127756842787055;  // x^7 = x + 1
  RigidStep point;
  double power = 1;
  for (int axis = 0; axis < 6; ++axis) {
    power /= ratio;
    const double at = 0.5 + power * number;
    point[axis] = 2 * (at - std::floor(at)) - 1;
  }
  return point;
}

std::vector<RigidTransform> candidates_about(const Model& model, const std::vector<RigidTransform>& starts,
                                             const SearchOptions& options) {
  std::vector<RigidTransform> candidates = starts;
  const int each = std::max(1, options.candidates / int(starts.size()));
  for (const RigidTransform& start : starts)
    for (int i = 1; i < each; ++i) {
      RigidStep step = sequence(i);
      step.head<3>() *= options.turn_deg * EIGEN_PI / 180;
      step.tail<3>() *= options.shift_mm;
      candidates.push_back(moved_about(start, start * model.centre, step));
    }
  return candidates;
}

/// Indices of the best candidates, none within `apart_mm` of a better one.
std::vector<std::size_t> best_of(const Model& model, const std::vector<RigidTransform>& poses,
                                 const std::vector<double>& scores, int count, double apart_mm) {
  std::vector<std::size_t> order(poses.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, [&](std::size_t a, std::size_t b) { return scores[a] > scores[b]; });
  std::vector<std::size_t> kept;
  for (const std::size_t i : order) {
    if (int(kept.size()) == count) break;
    if (std::ranges::none_of(kept,
                             [&](std::size_t k) { return separation(model, poses[i], poses[k]) < apart_mm; }))
      kept.push_back(i);
  }
  return kept;
}

}  // namespace

SearchResult search(Scene& scene, const std::vector<SearchStage>& stages,
                    const std::vector<RigidTransform>& starts, const SearchOptions& options, double same_mm) {
  const Model& model = scene.model();
  for (const SearchStage& stage : stages) scene.prepare(stage.level, starts.front() * model.centre);
  const auto candidates = candidates_about(model, starts, options);
  std::vector<double> scores(candidates.size());
  parallel_for(candidates.size(), scene.threads(), [&](std::size_t i) {
    scores[i] = scene.observe(stages.front().level, candidates[i], false, 1).score();
  });
  std::vector<RigidTransform> poses;
  if (starts.size() <= 3) poses = starts;  // a given pose is tried whatever its score
  for (const std::size_t i :
       best_of(model, candidates, scores, stages.front().keep, stages.front().level.spacing_mm))
    poses.push_back(candidates[i]);
  SearchResult result;
  result.starts = int(poses.size());
  std::vector<RigidTransform> ends;
  for (const SearchStage& stage : stages) {
    // Coarse levels can lead away from a good start.
    if (&stage != &stages.front() && starts.size() <= 3)
      poses.insert(poses.end(), starts.begin(), starts.end());
    std::vector<Estimate> estimates(poses.size());
    const bool few = poses.size() < 2 * std::size_t{std::max(1U, scene.threads())};
    parallel_for(poses.size(), few ? 1 : scene.threads(), [&](std::size_t i) {
      estimates[i] = refine(scene, stage.level, poses[i],
                            {.iterations = 15,
                             .converged = &stage == &stages.back() ? 0.002 : 0.02,
                             .threads = few ? scene.threads() : 1});
    });
    if (poses.size() + 3 >= std::size_t(result.starts)) {
      ends.clear();
      for (const Estimate& estimate : estimates) ends.push_back(estimate.pose);
    }
    std::vector<RigidTransform> reached;
    std::vector<double> finals;
    for (const Estimate& estimate : estimates)
      reached.push_back(estimate.pose), finals.push_back(estimate.score);
    const bool last = &stage == &stages.back();
    const int keep = last ? int(poses.size()) : (&stage)[1].keep;
    poses.clear();
    const auto order = best_of(model, reached, finals, std::max(2, keep), same_mm);
    if (order.size() > 1) {
      result.runner_up = estimates[order[1]];
      result.runner_up_best = finals[order[0]];
    }
    for (std::size_t k = 0; k < order.size() && int(k) < keep; ++k) {
      poses.push_back(reached[order[k]]);
      if (last) result.solutions.push_back(std::move(estimates[order[k]]));
    }
  }
  // The last stages move the best a little: what ended near its coarse place agrees.
  for (const RigidTransform& end : ends)
    if (separation(model, end, result.solutions.front().pose) < 2 * same_mm) ++result.agree;
  return result;
}

}  // namespace helicarm::registration
