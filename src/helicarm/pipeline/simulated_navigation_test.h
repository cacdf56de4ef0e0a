// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/pipeline/measure.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::pipeline {

inline Expected<Result> result_of(const Case& the_case, const RunOptions& options,
                                  const Progress& progress = {}) {
  return measure(the_case, options, progress);
}

/// One simulated case for all tests: 512 x 512 pixels, tunnels, tracker and tool lines.
class SimulatedNavigation : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::filesystem::temp_directory_path() / ("helicarm_run_" + std::to_string(::getpid()));
    simulation::SimulationOptions options;
    options.kind = simulation::CaseKind::tunnels;
    options.size = 512;
    options.seed = 5;
    truth_ = *simulation::simulate_case(options);
    ASSERT_TRUE(simulation::write_case(folder_, truth_).has_value());
  }
  static void TearDownTestSuite() { std::filesystem::remove_all(folder_); }

  void SetUp() override { given_ = *read_case(folder_); }

  static inline std::filesystem::path folder_;
  static inline simulation::SimulatedCase truth_;
  Case given_;
};

inline const Finding* find_reason(const std::vector<Finding>& warnings, Reason reason) {
  const auto found = std::ranges::find(warnings, reason, &Warning::reason);
  return found == warnings.end() ? nullptr : &*found;
}

}  // namespace helicarm::pipeline
