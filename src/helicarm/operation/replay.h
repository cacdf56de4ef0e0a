// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "helicarm/core/failure.h"

namespace helicarm {

struct ReplayReport {
  std::size_t records = 0;
  bool torn = false;      ///< the program was killed while it wrote the last record
  bool finished = false;  ///< the operation came to its end
  std::size_t exposures = 0;
  std::size_t images = 0;
  std::size_t results = 0;
  std::size_t hand_eyes = 0;
  std::vector<std::string> differences;  ///< what came out otherwise than recorded
};

/// Told before each record how many are done; answers whether to go on.
using GoOn = std::function<bool(std::size_t done, std::size_t all)>;

/// Recomputes an operation from its record: poses of the acquisitions from the tracker's samples, every case
/// from its images (which must be those recorded), the hand-eye calibration from its pairs; all must come
/// out to the last bit. Refuses as `read_session`, a record that holds nothing (bad_value), and where it may
/// not go on (interrupted).
Expected<ReplayReport> replay(
    const std::filesystem::path& session, const GoOn& go_on = [](std::size_t, std::size_t) { return true; });

}  // namespace helicarm
