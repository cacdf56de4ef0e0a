// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <vector>

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
};

struct SearchResult {
  std::vector<Estimate> solutions;  ///< of the last level, distinct, best first
  /// Best distinct one of the last level or, where all became one there, of those that a level before left
  /// behind; and the best's score at its level.
  std::optional<Estimate> runner_up;
  double runner_up_best = 0;
  int starts = 0;  ///< refined
  int agree = 0;   ///< of them, that led to the best: at each level what ends within `same_mm` goes on as one
};

/// Poses about the starts in a low-discrepancy sequence (each start first), the best of which are refined
/// stage by stage. Solutions closer than `same_mm` (rms over the model) are one. The result does not depend
/// on the number of threads.
SearchResult search(Scene& scene, const std::vector<SearchStage>& stages,
                    const std::vector<geometry::RigidTransform>& starts, const SearchOptions& options,
                    double same_mm);

}  // namespace helicarm::registration
