// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/c_arm_history.h"
#include "json_target.h"

namespace helicarm::fuzz {
namespace {

Json write(const calibration::CArmHistory& history) { return to_json(history); }

}  // namespace

void run(std::string_view bytes) {
  const auto read = [](const Json& json) { return calibration::history_from_json(json, "machine.json"); };
  run_round_trip(bytes, read, write);
  const auto json = parse_json(bytes, "machine.json");
  if (!json) return;
  const auto history = read(*json);
  if (!history) return;
  calibration::CArmPrior unknown;
  unknown.focal = calibration::IntrinsicsVariation{40, 5};
  unknown.principal = calibration::IntrinsicsVariation{10, 2};
  check(calibration::learn_intrinsics(history->entries, {1000, 0, 0}, unknown).mean_mm.allFinite(),
        "accepted values are finite");
}

std::vector<std::string> seeds() {
  calibration::CArmHistory history;
  history.entries.push_back({"00112233", "AP", {1000, 2, -3}, Eigen::Vector3d(0.1, 0.2, 0.3).asDiagonal()});
  history.entries.push_back({"44556677", "LAT", {1010, 1, -2}, 0.5 * Eigen::Matrix3d::Identity()});
  return {write(calibration::CArmHistory{}).dump(), write(history).dump()};
}

}  // namespace helicarm::fuzz
