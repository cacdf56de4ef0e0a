// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/robot_registry.h"

#include <algorithm>
#include <array>
#include <vector>

#include <fmt/format.h>

#include "helicarm/devices/robot/ur_driver.h"

namespace helicarm::robot {
namespace {

struct Entry {
  RobotModel (*model)();
  std::unique_ptr<RobotDriver> (*driver)(const RobotAddress&);
};

constexpr std::array entries{Entry{ur5, ur_driver}, Entry{ur5e, ur_driver}};

Expected<Entry> entry_of(const std::string& name) {
  const auto found = std::ranges::find_if(entries, [&](const Entry& e) { return e.model().name == name; });
  if (found != entries.end()) return *found;
  std::vector<std::string> names;
  for (const Entry& entry : entries) names.push_back('"' + entry.model().name + '"');
  return fail(Reason::bad_value, fmt::format("robot: must be {}", fmt::join(names, " or ")));
}

}  // namespace

Expected<RobotModel> robot_model(const std::string& name) {
  return entry_of(name).map([](const Entry& entry) { return entry.model(); });
}

std::unique_ptr<RobotDriver> open_driver(const RobotAddress& address) {
  return value_or_throw(entry_of(address.model.name)).driver(address);
}

}  // namespace helicarm::robot
