// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "helicarm/devices/robot/virtual_controller.h"

namespace helicarm {

/// Ports 0 take any free one.
struct VirtualUrOptions {
  RobotModel controller = ur5();  ///< what the controller believes of its arm
  RobotModel arm = ur5();         ///< what the arm is
  RobotTool tool = {};
  Joints joints = (Joints() << 0, -1.6, -1.6, -1.5, 1.6, 0).finished();
  std::string address = "127.0.0.1";
  std::uint16_t rtde_port = 30004;
  std::uint16_t dashboard_port = 29999;
  std::uint16_t script_port = 30002;
  /// The clock goes on by one period with each heartbeat's message and by `advance`, not with the time of
  /// day: what happens then depends on no machine's speed.
  bool lockstep = false;
  /// A line for a log on each client that was cut off, at most 20 a second; on the robot's thread.
  std::function<void(const std::string&)> on_notice = [](const std::string&) {};
};

/// Clients of each port at once; then the oldest that does not command makes room.
inline constexpr int most_clients_of_port = 16;

struct VirtualUrCounters {
  std::size_t clients = 0;  ///< now
  std::uint64_t connections = 0;
  std::uint64_t cut = 0;              ///< clients that did not read, sent too much or made room for another
  std::uint64_t accept_failures = 0;  ///< out of descriptors, say
};

/// What only the virtual robot knows.
struct VirtualTruth {
  RobotState state;              ///< as the controller has it
  RigidTransform base_from_tip;  ///< of the true arm
  bool moving = false;
  std::optional<double> rest_since_s;  ///< on the robot's clock
  std::string script_error;
  std::size_t waiting_scripts = 0;    ///< have come, but do not start yet
  std::size_t waiting_questions = 0;  ///< at the dashboard, while it is held
};

/// A UR5 or UR5e on this machine: RTDE, dashboard and secondary port, and an arm that moves. It runs on a
/// thread of its own and ends at once.
class VirtualUr {
 public:
  /// Refuses an address that is not this machine's (bad_value) and a port in use (`port_taken`).
  static Expected<std::unique_ptr<VirtualUr>> start(const VirtualUrOptions& options);
  ~VirtualUr();

  std::uint16_t rtde_port() const;
  std::uint16_t dashboard_port() const;
  std::uint16_t script_port() const;

  void set(RobotFault fault, bool on = true);
  /// On the robot's clock: what happens does not depend on any machine's speed.
  void set_at(RobotFault fault, double time_s);
  /// As if somebody had asked at the dashboard.
  std::string dashboard(const std::string& command);
  /// As `VirtualController::delay_scripts`.
  void delay_scripts(std::vector<double> delays_s);
  /// While it is held the dashboard answers nothing; then it answers all that was asked.
  void hold_dashboard(bool on);
  /// In lockstep: lets this much time pass on the robot's clock, whether anybody beats or not.
  void advance(double seconds);
  VirtualTruth truth();
  VirtualUrCounters counters();

 private:
  class Server;
  explicit VirtualUr(std::unique_ptr<Server> server);
  std::unique_ptr<Server> server_;
};

}  // namespace helicarm
