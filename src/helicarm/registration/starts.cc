// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/starts.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>

#include "helicarm/core/parallel.h"

namespace helicarm::registration {
namespace {

using geometry::RigidTransform;

constexpr std::size_t most_given = 3;  // starts that are tried whatever their score
constexpr std::size_t most_alternatives = 2;
constexpr double visible_share = 0.2;  // of the model's radius, between poses to choose from

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

/// A pose on its way through the stages, and the numbers of the starts that led to it.
struct Descent {
  RigidTransform pose;
  std::set<std::size_t> starts;
};

/// The given starts, then the best poses about them.
std::vector<Descent> first_poses(const RegistrationProblem& scene, const SearchStage& stage,
                                 const std::vector<RigidTransform>& starts, const SearchOptions& options,
                                 TellShare share) {
  std::vector<Descent> first;
  const auto add = [&](const RigidTransform& pose) { first.push_back({pose, {first.size()}}); };
  const bool all_go = starts.size() <= most_given || options.candidates == 0;
  if (all_go) std::ranges::for_each(starts, add);
  if (options.candidates == 0) return first;
  const auto candidates = candidates_about(scene.model(), starts, options);
  std::vector<double> scores(candidates.size());
  UnitsDone done(std::move(share), candidates.size());
  parallel_for(candidates.size(), scene.threads(), [&](std::size_t i) {
    if (options.interrupt) options.interrupt();
    scores[i] = scene.observe(stage.level, candidates[i], false, 1).score();
    done.one();
  });
  for (const std::size_t i : best_of(scene.model(), candidates, scores, stage.keep, stage.level.spacing_mm))
    if (!all_go || i >= starts.size()) add(candidates[i]);  // the first candidates are the starts
  return first;
}

std::vector<Estimate> refined(const RegistrationProblem& scene, const Level& level,
                              const std::vector<Descent>& from, double converged,
                              const SearchOptions& options, TellShare share) {
  std::vector<Estimate> estimates(from.size());
  UnitsDone done(std::move(share), from.size());
  const bool few = from.size() < 2 * std::size_t{std::max(1U, scene.threads())};
  parallel_for(from.size(), few ? 1 : scene.threads(), [&](std::size_t i) {
    if (options.interrupt) options.interrupt();
    estimates[i] = refine(scene, level, from[i].pose,
                          {.iterations = 15, .converged = converged, .threads = few ? scene.threads() : 1});
    done.one();
  });
  return estimates;
}

/// Keeps the first few that differ visibly from the solution and each other.
void keep_distinct(const Model& model, const RigidTransform& solution,
                   std::vector<Alternative>& alternatives) {
  const double visible_mm = visible_share * model.radius_mm;
  std::vector<Alternative> kept;
  for (Alternative& each : alternatives) {
    each.distance_mm = separation(model, solution, each.world_from_model);
    if (kept.size() < most_alternatives && each.distance_mm > visible_mm &&
        std::ranges::none_of(kept, [&](const Alternative& other) {
          return separation(model, other.world_from_model, each.world_from_model) < visible_mm;
        }))
      kept.push_back(each);
  }
  alternatives = std::move(kept);
}

}  // namespace

SearchResult search(RegistrationProblem& scene, const std::vector<SearchStage>& stages,
                    const std::vector<RigidTransform>& starts, const SearchOptions& options, double same_mm) {
  const Model& model = scene.model();
  for (const SearchStage& stage : stages) scene.prepare(stage.level, starts.front() * model.centre);
  const auto part = [&](std::size_t number) {
    const double each = 1 / double(stages.size() + 1);
    return part_of(options.share, double(number) * each, double(number + 1) * each);
  };
  std::vector<Descent> descents = first_poses(scene, stages.front(), starts, options, part(0));
  SearchResult result;
  result.starts = int(descents.size());
  for (const SearchStage& stage : stages) {
    const bool last = &stage == &stages.back();
    // Coarse levels can lead away from a good start.
    if (&stage != &stages.front() && !last && starts.size() <= most_given && options.candidates > 0)
      for (std::size_t i = 0; i < starts.size(); ++i) descents.push_back({starts[i], {i}});
    auto estimates = refined(scene, stage.level, descents, last ? 0.002 : 0.02, options,
                             part(1 + std::size_t(&stage - stages.data())));
    std::vector<RigidTransform> reached;
    std::vector<double> scores;
    for (const Estimate& estimate : estimates)
      reached.push_back(estimate.pose), scores.push_back(estimate.score);
    std::size_t keep = last ? estimates.size() : std::size_t((&stage)[1].keep);
    auto kept = best_of(model, reached, scores, int(keep + most_alternatives), same_mm);
    if (!last)
      while (keep > 1 && (kept.size() < keep ||
                          1 - scores[kept[keep - 1]] > (&stage)[1].most_ratio * (1 - scores[kept[0]])))
        --keep;
    // What goes on and merges with the best was no rival; at the last level nothing goes on.
    const std::size_t rival = last ? 1 : keep;
    std::vector<Alternative> left;
    for (std::size_t k = rival; k < kept.size(); ++k)
      left.push_back({reached[kept[k]], 0, (1 - scores[kept[k]]) / (1 - scores[kept[0]])});
    result.alternatives.insert(result.alternatives.begin(), left.begin(), left.end());
    if (kept.size() > rival &&
        (last || separation(model, reached[kept[rival]], reached[kept[0]]) > 2 * stage.level.spacing_mm)) {
      result.runner_up = estimates[kept[rival]];
      result.runner_up_best = scores[kept[0]];
    }
    kept.resize(std::min(kept.size(), keep));
    std::vector<Descent> next;
    for (const std::size_t k : kept) next.push_back({reached[k], {}});
    for (std::size_t i = 0; i < descents.size(); ++i) {
      const auto same = std::ranges::find_if(next, [&](const Descent& descent) {
        return separation(model, descent.pose, reached[i]) < same_mm;
      });
      if (same != next.end()) same->starts.insert(descents[i].starts.begin(), descents[i].starts.end());
    }
    if (last)
      for (const std::size_t k : kept) result.solutions.push_back(std::move(estimates[k]));
    descents = std::move(next);
  }
  result.agree = int(descents.front().starts.size());
  keep_distinct(model, result.solutions.front().pose, result.alternatives);
  return result;
}

}  // namespace helicarm::registration
