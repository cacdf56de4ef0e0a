// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "helicarm/core/temporary_folder.h"
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
  explicit PhantomFolder(const simulation::SimulatedCase& simulated) {
    EXPECT_TRUE(simulation::write_case(folder_.path() / "case", simulated));
    the_case = *pipeline::read_case(folder_.path() / "case", pipeline::Purpose::phantom);
    the_case.calibrator.targets.clear();
  }

  phantom::CalibratorBall& ball(const std::string& label) {
    return *std::ranges::find(the_case.calibrator.balls, label, &phantom::CalibratorBall::label);
  }

  pipeline::Case the_case;

 private:
  TemporaryFolder folder_;
};

}  // namespace helicarm::phantom_calibration
