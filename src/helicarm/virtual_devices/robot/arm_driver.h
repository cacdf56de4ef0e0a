// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "helicarm/devices/robot/robot_driver.h"

namespace helicarm::robot {

struct ArmOptions {
  RobotModel model = ur5();
  RobotTool tool = {};
  Joints joints = Joints::Zero();  ///< at the beginning
  double speed_up = 1;             ///< of the arm's clock against wall time
};

/// A virtual arm in this process as a robot: orders are carried out directly, without network, script or
/// dashboard. It shows what a driver needs (docs/add-a-device.md), and is a robot for tests.
class ArmDriver : public RobotDriver {
 public:
  explicit ArmDriver(const ArmOptions& options);
  ~ArmDriver() override;

  void start(RobotListener listener) override;
  Expected<void> check_remote_control() override;
  Expected<void> release_protective_stop() override;
  Expected<std::unique_ptr<OrderChannel>> open_channel() override;

  // Thread-safe, for tests.
  void set_local_mode(bool on);
  void set_protective_stop(bool on);
  /// While cut, states and heartbeats are lost, as are new orders.
  void cut_cable(bool on);
  RobotState state() const;
  bool moving() const;

 private:
  struct Controller;
  struct Channel;
  class Stepping;
  std::shared_ptr<Controller> controller_;  ///< shared with channels
  double speed_up_;
  std::unique_ptr<Stepping> stepping_;
};

}  // namespace helicarm::robot
