// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/machine.h"
#include "json_target.h"

namespace helicarm::fuzz {
namespace {

Json write(const Machine& history) { return to_json(history); }

}  // namespace

void run(std::string_view bytes) {
  const auto read = [](const Json& json) { return machine_from_json(json, "machine.json"); };
  run_round_trip(bytes, read, write);
  const auto json = parse_json(bytes, "machine.json");
  if (!json) return;
  const auto history = read(*json);
  if (!history) return;
  MachinePrior unknown;
  unknown.focal = Departure{40, 5};
  unknown.principal = Departure{10, 2};
  check(knowledge_of(history->shots, {1000, 0, 0}, unknown).mean_mm.allFinite(), "what is known is finite");
}

std::vector<std::string> seeds() {
  Machine history;
  history.shots.push_back({"00112233", "AP", {1000, 2, -3}, Eigen::Vector3d(0.1, 0.2, 0.3).asDiagonal()});
  history.shots.push_back({"44556677", "LAT", {1010, 1, -2}, 0.5 * Eigen::Matrix3d::Identity()});
  return {write(Machine{}).dump(), write(history).dump()};
}

}  // namespace helicarm::fuzz
