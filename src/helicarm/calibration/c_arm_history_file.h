// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/c_arm_history.h"

namespace helicarm::calibration {

/// What a file of the history holds, and what was added to it.
struct HistoryGrowth {
  std::size_t earlier = 0;
  std::size_t added = 0;
};
/// Adds entries to the file under its lock, to what other programs added meanwhile; creates it if needed.
/// Refuses as `read_history` and `FileLock`.
Expected<HistoryGrowth> add_to_history(const std::filesystem::path& path,
                                       std::span<const HistoryEntry> entries);
/// Whether entries can be added to the file (cannot_write): ask before a measurement.
Expected<void> check_history_file(const std::filesystem::path& path);

}  // namespace helicarm::calibration
