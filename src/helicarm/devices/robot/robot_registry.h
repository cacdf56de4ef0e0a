// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "helicarm/devices/robot/robot_driver.h"

namespace helicarm::robot {

/// The only place that lists robots: names in plans and orders, nominal arms, drivers.

/// "UR5" or "UR5e"; another name is bad_value.
Expected<RobotModel> robot_model(const std::string& name);

/// Driver of the address's model. Throws BadInput (bad_value) for a model without one.
std::unique_ptr<RobotDriver> open_driver(const RobotAddress& address);

}  // namespace helicarm::robot
