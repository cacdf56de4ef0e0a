// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/check_order.h"
#include "helicarm/devices/robot/robot_order.h"
#include "helicarm/devices/robot/robot_scene_test.h"
#include "json_target.h"

namespace helicarm::fuzz {
namespace {

Json write(const robot::RobotOrder& order) { return to_json(order); }

}  // namespace

void run(std::string_view bytes) {
  const auto read = [](const Json& json) { return robot::robot_order_from(json, "order.json"); };
  const auto json = parse_json(bytes, "order.json");
  if (!json) return;
  const auto order = read(*json);
  if (!order) return;
  check(all_finite(write(*order)), "accepted numbers are finite");
  // Angles are converted through degrees: a second reading may differ in the last bit.
  check(read(write(*order)).has_value(), "written data are accepted");
  (void)check_order(*order, robot::resting_state());
}

std::vector<std::string> seeds() { return {write(robot::planned()).dump()}; }

}  // namespace helicarm::fuzz
