// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "helicarm/core/work_share.h"
#include "helicarm/registration/estimate.h"

namespace helicarm::registration {

/// A level of a search and how many of the best solutions of the level before go on to it.
struct SearchStage {
  Level level;
  int keep = 16;
  double most_ratio = 1e9;  ///< of its cost, 1 - score, to the best one's: what is beyond does not go on
};

struct SearchOptions {
  double shift_mm = 15;  ///< per axis, about each start
  double turn_deg = 15;
  int candidates = 600;                  ///< scored at the first level; 0: the starts alone are refined
  std::function<void()> interrupt = {};  ///< called often, from any thread: its exception ends the search
  TellShare share = {};                  ///< of a search, or of the whole registration
  /// After a refusal in two views or more every orientation and position is searched (`poses_anywhere`).
  bool anywhere_after_refusal = true;
};

/// Another distinct pose, of whatever level left it behind.
struct Alternative {
  geometry::RigidTransform world_from_model;
  double distance_mm = 0;  ///< from the solution, rms over the model
  double cost_ratio = 0;   ///< (1 - its score) / (1 - the best's) at that level: 1 is as good
};

struct SearchResult {
  std::vector<Estimate> solutions;  ///< of the last level, distinct, best first
  /// Best distinct one of the last level or, where all became one there, of those that a level before left
  /// behind; and the best's score at its level.
  std::optional<Estimate> runner_up;
  double runner_up_best = 0;
  std::vector<Alternative> alternatives = {};  ///< to the best, of the finest levels first
  int starts = 0;                              ///< refined
  int agree = 0;  ///< of them, that led to the best: at each level what ends within `same_mm` goes on as one
};

/// Poses about the starts in a low-discrepancy sequence (each start first), the best of which are refined
/// stage by stage. Solutions closer than `same_mm` (rms over the model) are one. The result does not depend
/// on the number of threads.
SearchResult search(RegistrationProblem& scene, const std::vector<SearchStage>& stages,
                    const std::vector<geometry::RigidTransform>& starts, const SearchOptions& options,
                    double same_mm);

}  // namespace helicarm::registration
