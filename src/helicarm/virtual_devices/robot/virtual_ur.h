// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "helicarm/virtual_devices/robot/virtual_controller.h"

namespace helicarm::robot {

/// Ports 0 use any free one.
struct VirtualUrOptions {
  RobotModel controller = ur5();  ///< the controller's model of its arm
  RobotModel arm = ur5();         ///< the true arm
  RobotTool tool = {};
  Joints joints = (Joints() << 0, -1.6, -1.6, -1.5, 1.6, 0).finished();
  std::string address = "127.0.0.1";
  std::uint16_t rtde_port = 30004;
  std::uint16_t dashboard_port = 29999;
  std::uint16_t script_port = 30002;
  std::uint16_t primary_port = 0;  ///< 30001 on a real robot: scripts, version, and modes at 10 Hz
  /// The clock advances by one period per heartbeat message and by `advance`, not with wall time: results do
  /// not depend on the machine's speed.
  bool lockstep = false;
  /// Log line for each disconnected client, at most 20 per second; called on the robot's thread.
  std::function<void(const std::string&)> on_notice = [](const std::string&) {};
};

/// Clients per port; beyond, the oldest that does not command is disconnected.
inline constexpr int most_clients_of_port = 16;

struct VirtualUrCounters {
  std::size_t clients = 0;  ///< present
  std::uint64_t connections = 0;
  std::uint64_t cut = 0;              ///< disconnected clients: did not read, sent too much or were replaced
  std::uint64_t accept_failures = 0;  ///< e.g. no file descriptors
};

/// Ground truth of the virtual robot.
struct VirtualTruth {
  RobotState state;                        ///< the controller's
  geometry::RigidTransform base_from_tip;  ///< of the true arm
  bool moving = false;
  std::optional<double> rest_since_s;  ///< on the robot's clock
  std::string script_error;
  std::size_t waiting_scripts = 0;    ///< received, not yet started
  std::size_t waiting_questions = 0;  ///< dashboard commands while it is held
};

/// A UR5 or UR5e on this machine: RTDE, dashboard, primary and secondary port, and a moving arm, on its own
/// thread. Stops immediately.
class VirtualUr {
 public:
  /// Refuses an address that is not local (bad_value) and a port in use (`port_taken`).
  static Expected<std::unique_ptr<VirtualUr>> start(const VirtualUrOptions& options);
  ~VirtualUr();

  std::uint16_t rtde_port() const;
  std::uint16_t dashboard_port() const;
  std::uint16_t script_port() const;
  std::uint16_t primary_port() const;

  void set(RobotFault fault, bool on = true);
  /// On the robot's clock, independent of the machine's speed.
  void set_at(RobotFault fault, double time_s);
  /// A dashboard command.
  std::string dashboard(const std::string& command);
  /// As `VirtualController::delay_scripts`.
  void delay_scripts(std::vector<double> delays_s);
  /// While held the dashboard does not answer; then it answers all pending commands.
  void hold_dashboard(bool on);
  /// In lockstep: advances the robot's clock, with or without heartbeats.
  void advance(double seconds);
  VirtualTruth truth();
  VirtualUrCounters counters();

 private:
  class Server;
  explicit VirtualUr(std::unique_ptr<Server> server);
  std::unique_ptr<Server> server_;
};

}  // namespace helicarm::robot
