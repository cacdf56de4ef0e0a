// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/calibration/c_arm_history.h"

namespace helicarm::calibration {

/// What a file of the history holds, and what was added to it.
struct HistoryGrowth {
  std::size_t earlier = 0;
  std::size_t added = 0;
  bool is_new = false;  ///< there was no file
};
/// Adds entries, and the isocentre of their run, to the file under its lock, to what other programs added
/// meanwhile; creates it if needed. `date`: of the acquisitions, like 2026-11-26; by default today. Refuses
/// as `read_history` and `FileLock`, and bad_value a date that is none up to today.
Expected<HistoryGrowth> add_to_history(const std::filesystem::path& path,
                                       std::span<const HistoryEntry> entries,
                                       const std::optional<RunIsocentre>& run = {},
                                       const std::optional<std::string>& date = {});
/// Whether it is a day up to today (bad_value): ask before a measurement.
Expected<void> check_acquisition_day(const std::string& date);
/// Whether entries can be added to the file (cannot_write): ask before a measurement.
Expected<void> check_history_file(const std::filesystem::path& path);

/// The array `shots` of machine.json; results carry the same as `acquisitions`.
Json acquisitions_json(const std::vector<HistoryEntry>& entries);
/// The JSON Schema of machine.json.
Json history_schema();
/// Of a result (helicarm-result/1) or a run of images (helicarm-sweep/1). Refuses one that was refused or
/// holds none (too_few_views), with what to do.
Expected<std::vector<HistoryEntry>> acquisitions_of_result(const Json& json, const std::string& origin);
/// Of a run of images that tells of the C-arm; nothing of a result or a run without a path.
Expected<std::optional<RunIsocentre>> isocentre_of_result(const Json& json, const std::string& origin);

}  // namespace helicarm::calibration
