// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "helicarm/devices/robot/robot_order.h"
#include "helicarm/devices/robot/robot_state.h"

namespace helicarm::robot {

/// Where a robot is reached; its model decides on the driver (`open_driver`). Ports that a driver does not
/// know are ignored.
struct RobotAddress {
  RobotModel model = ur5();
  std::string address = "127.0.0.1";
  std::uint16_t rtde_port = 30004;
  std::uint16_t dashboard_port = 29999;
  std::uint16_t script_port = 30002;
  double lost_s = 1;        ///< reconnect after this time without an answer or a state
  double rate_hz = 0;       ///< of the states; 0: the model's
  bool reads_only = false;  ///< nothing is written to the robot, so another program may command it
};

/// Called on the driver's thread, one at a time, and never within a member of the driver or of a channel,
/// some of which are called under a lock that these functions take.
struct RobotListener {
  std::function<void(const ControllerVersion&)> connected;  ///< before the first state of each connection
  std::function<Heartbeat(const RobotState&)> state;        ///< the answer goes to the robot at once
  std::function<void(const Failure&)> lost;                 ///< end of a connection or of an attempt
};

/// Carries one order to the robot. Destruction withdraws an order that has not begun; it may come after the
/// driver's.
class OrderChannel {
 public:
  virtual ~OrderChannel() = default;
  /// Hands over the order in at most 50 ms, under the link's lock. Refuses not_connected.
  virtual Expected<void> send(const RobotOrder& order, OrderNumber number) = 0;
};

/// A manufacturer's protocol below `RobotLink`, which decides what may move. The robot, not this class, has
/// to keep to the following, as a program may end at any time: an order moves only while the newest heartbeat
/// carries its number, is positive and at most `silence_s` old by the order's own ticks; otherwise it brakes
/// and ends; it begins at most once. The state reports number, stage and ticks of the last order.
///
/// Members after `start` are called from any thread, also at the same time. The destructor ends the driver's
/// thread.
class RobotDriver {
 public:
  virtual ~RobotDriver() = default;

  /// Connects, and again after each loss, until destruction. Call once.
  virtual void start(RobotListener listener) = 0;

  /// Refuses robot_locked if the robot takes orders at its own panel only, not_connected without an answer.
  virtual Expected<void> check_remote_control() = 0;

  /// Releases a protective stop. Refuses robot_stopped with the robot's answer.
  virtual Expected<void> release_protective_stop() = 0;

  /// Prepares to send one order, in at most 1 s. Refuses not_connected.
  virtual Expected<std::unique_ptr<OrderChannel>> open_channel() = 0;

  /// What is known against this version of the controller's software.
  virtual std::vector<Warning> advisories(const ControllerVersion&) const { return {}; }
};

}  // namespace helicarm::robot
