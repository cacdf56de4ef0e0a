// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "studies/ranks.h"

namespace helicarm::study {

/// One setting of a study: trials in blocks of fixed size. A block's values must depend only on its number,
/// so that threads, ranks and restarts do not change them.
struct StudySetting {
  std::size_t blocks;
  std::size_t values_per_block;
  double cost = 1;  ///< of the whole setting, in any unit, to estimate the remaining time
  std::function<void(std::size_t block, std::span<double> values)> work = {};
  /// Reduces the values of all blocks, in order, to those that are kept. Empty: all are kept.
  std::function<std::vector<double>(std::span<const double> values)> settle = {};
};

struct EngineOptions {
  unsigned threads = 0;           ///< per rank; 0: all cores, shared by the ranks
  std::filesystem::path journal;  ///< file of finished blocks; empty: none
  bool resume = false;            ///< continue from the journal if it exists
  double journal_after_s = 0.5;   ///< shorter runs write no journal
  std::function<void(double share)> progress = [](double) {};
};

/// Returns what is kept of each setting, in order; nothing at ranks other than the leader. Each finished
/// block goes to the journal, so that a killed run loses at most the running blocks (and the first
/// `journal_after_s`). `identity` identifies the study: the journal of another one is refused (bad_value).
/// The caller removes the journal once the answer is saved.
Expected<std::vector<std::vector<double>>> run_study(const std::vector<StudySetting>& settings,
                                                     const std::string& identity,
                                                     const EngineOptions& options, const Ranks& ranks);

}  // namespace helicarm::study
