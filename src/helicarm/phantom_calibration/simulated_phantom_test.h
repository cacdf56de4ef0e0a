// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <unistd.h>

#include "helicarm/pipeline/case.h"
#include "helicarm/simulation/write_case.h"

namespace helicarm::phantom_calibration {

/// Flat-panel images of the calibrator alone, 512 pixels a side, at these primary angles.
inline simulation::SimulatedCase simulated_phantom(const std::vector<double>& angles_deg,
                                                   const std::vector<std::string>& lost = {}) {
  simulation::SimulationOptions options;
  options.kind = simulation::CaseKind::flat;
  options.size = 512;
  options.seed = 5;
  options.knee = false;
  options.lost_balls = lost;
  for (const double angle : angles_deg)
    options.views.push_back(
        {std::string(1, char('A' + options.views.size())), {angle, options.views.size() % 2 ? 10.0 : 0}});
  return *simulation::simulate_case(options);
}

/// The case as read from its files, which lie in a folder of their own until the test ends.
class PhantomFolder {
 public:
  explicit PhantomFolder(const simulation::SimulatedCase& simulated)
      : path_(std::filesystem::temp_directory_path() / ("helicarm_phantom_" + std::to_string(::getpid()))) {
    EXPECT_TRUE(simulation::write_case(path_, simulated));
    given = *pipeline::read_phantom_case(path_);
    given.calibrator.targets.clear();
  }
  ~PhantomFolder() { std::filesystem::remove_all(path_); }
  PhantomFolder(const PhantomFolder&) = delete;
  PhantomFolder& operator=(const PhantomFolder&) = delete;

  phantom::CalibratorBall& ball(const std::string& label) {
    return *std::ranges::find(given.calibrator.balls, label, &phantom::CalibratorBall::label);
  }

  pipeline::Case given;

 private:
  std::filesystem::path path_;
};

}  // namespace helicarm::phantom_calibration
