// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/migration/migrate.h"

namespace helicarm::migration {

/// A segment with its markers that correspond, each where both examinations located it.
struct Matched {
  MatchedSegment segment;
  std::vector<Marker> first, second;

  /// By the markers' stated errors.
  void refit();
  void leave_out(std::size_t n);
};

/// A segment of the first examination in the second, fitted. Warns and throws as `migrate` says.
Matched matched_segment(const Exam& first, const Exam& second, const Segment& segment, Matching matching,
                        std::vector<Warning>& warnings);

}  // namespace helicarm::migration
