// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"

namespace helicarm::operation {

struct ReplayReport {
  std::size_t records = 0;
  bool torn = false;      ///< the last record is incomplete: the program was killed while writing
  bool finished = false;  ///< the operation was ended
  std::size_t exposures = 0;
  std::size_t images = 0;
  std::size_t results = 0;
  std::size_t hand_eyes = 0;
  std::size_t decisions = 0;             ///< on a hand-held drill
  std::vector<std::string> differences;  ///< recomputed values that differ from the record
};

/// Called before each record with the number done; false stops the replay.
using GoOn = std::function<bool(std::size_t done, std::size_t all)>;

/// Recomputes an operation from its record: acquisition poses from the tracker samples, each case from its
/// images (which must be the recorded ones), the hand-eye calibration from its pairs, decisions
/// on a hand-held drill from the samples; all must agree to the
/// last bit. Refuses as `read_session`; an empty record (bad_value); a stop by the callback (interrupted).
Expected<ReplayReport> replay(
    const std::filesystem::path& session, const GoOn& go_on = [](std::size_t, std::size_t) { return true; });

}  // namespace helicarm::operation
