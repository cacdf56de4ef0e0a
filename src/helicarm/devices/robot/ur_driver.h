// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "helicarm/devices/robot/robot_driver.h"

namespace helicarm::robot {

/// Universal Robots CB3 and e-Series: states and heartbeats by RTDE, orders as scripts, queries by the
/// dashboard.
std::unique_ptr<RobotDriver> ur_driver(const RobotAddress& address);

}  // namespace helicarm::robot
