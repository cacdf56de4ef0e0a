// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace helicarm::simulation {

enum class CaseKind {
  accuracy,  ///< the paper's 3.2: intensifier, plate, five check targets
  tunnels,   ///< an ACL navigation: intensifier, plate, balls at the tunnels' ends, tracker and tool
  flat       ///< as accuracy, with a flat panel: no plate, no distortion
};

enum class Fault {
  decoys,     ///< two stray balls of the calibrator's size
  wires,      ///< a K-wire over a ball in each view
  screws,     ///< two screws in the tibia
  low_dose,   ///< a twentieth of the quanta
  shutters,   ///< collimator leaves inside the field
  mirrored,   ///< the lateral view is stored mirrored, and tagged so
  saturated,  ///< the open beam is beyond white
};

struct SimulationOptions {
  std::uint64_t seed = 1;
  CaseKind kind = CaseKind::accuracy;
  int size = 1024;  ///< 512 or 1024 pixels a side
  int bits = 12;    ///< 8, 12 or 16
  bool knee = true;
  std::vector<Fault> faults;
  std::vector<std::string> lost_balls;  ///< labels of balls that fell out of the calibrator
  unsigned threads = 0;

  bool has(Fault fault) const;
};

inline bool SimulationOptions::has(Fault fault) const {
  for (Fault each : faults)
    if (each == fault) return true;
  return false;
}

}  // namespace helicarm::simulation
