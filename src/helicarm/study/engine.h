// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/study/ranks.h"

namespace helicarm {

/// One setting of a study: trials in blocks of fixed size. A block's values must depend on its number alone,
/// so that neither threads nor ranks nor a fresh start change them.
struct StudySetting {
  std::size_t blocks;
  std::size_t values_per_block;
  double cost = 1;  ///< of the whole setting, in any unit: for the time left
  std::function<void(std::size_t block, std::span<double> values)> work = {};
  /// What is kept of the setting: is given the values of all blocks in order. None: all of them.
  std::function<std::vector<double>(std::span<const double> values)> settle = {};
};

struct EngineOptions {
  unsigned threads = 0;           ///< of each rank; 0: all cores, shared by the ranks
  std::filesystem::path journal;  ///< file that keeps what is done; empty: none
  bool resume = false;            ///< go on from the journal, where there is one
  double journal_after_s = 0.5;   ///< a run that is shorter leaves none
  std::function<void(double share)> progress = [](double) {};
};

/// What is kept of each setting, in order; at the ranks that do not lead, nothing. Finished blocks go to the
/// journal one by one, so that a run that was killed loses at most the blocks that were running (and the
/// first `journal_after_s`). `identity` tells studies apart: a journal of another one is refused (bad_value).
/// The caller removes the journal when the answer is safe.
Expected<std::vector<std::vector<double>>> run_study(const std::vector<StudySetting>& settings,
                                                     const std::string& identity,
                                                     const EngineOptions& options, const Ranks& ranks);

}  // namespace helicarm
