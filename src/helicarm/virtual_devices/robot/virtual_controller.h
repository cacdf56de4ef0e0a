// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "helicarm/devices/robot/robot_order.h"
#include "helicarm/devices/robot/robot_state.h"
#include "helicarm/virtual_devices/robot/urscript.h"
#include "helicarm/virtual_devices/robot/virtual_arm.h"

namespace helicarm::robot {

/// Faults of a virtual robot, by name.
enum class RobotFault {
  emergency_stop,
  protective_stop,
  safeguard_stop,
  violation,
  local_mode,
  brake_not_released,
  zero_speed,
  moved_by_hand,
  other_tool,
  clock_jump,
  frozen_states,
  cut_cable,
  half_packet,
  huge_packet,
  wrong_version,
  unknown_output,
  input_in_use,
  not_finite,
  late_script,   ///< each script starts 0.3 s after its arrival
  script_twice,  ///< immediately, and again 0.3 s later
};

/// Fault by its name in the list above, e.g. "cut_cable"; bad_value lists them all.
Expected<RobotFault> robot_fault(const std::string& name);
/// Names of all faults, for messages.
std::string robot_fault_names();

/// A virtual robot without its network: modes, stops, the running script, the arm. Advances only by `step`.
class VirtualController : public UrScriptHost {
 public:
  /// `model` is the controller's model of the arm.
  VirtualController(const RobotModel& model, const RobotTool& tool, const Joints& joints);

  void step();
  void set(RobotFault fault, bool on);
  /// At this time of its own clock.
  void set_at(RobotFault fault, double time_s) { coming_faults_.emplace(time_s, fault); }
  bool has(RobotFault fault) const { return faults_.contains(fault); }
  /// Starts a program, ending the running one, after each of the delays; ignored in local mode.
  void run_script(const std::string& text);
  /// From now on each script starts these times after its arrival, s: late, several times, or never if the
  /// list is empty.
  void delay_scripts(std::vector<double> delays_s) { script_delays_s_ = std::move(delays_s); }
  std::size_t waiting_scripts() const { return waiting_scripts_.size(); }
  /// Answer to one dashboard command, without line end. The virtual robot holds no program files.
  std::string dashboard(std::string_view command);
  /// Of the controller's software, on every port: major, minor, bugfix, build.
  std::array<std::uint32_t, 4> version() const;
  void set_heartbeat(const Heartbeat& heartbeat) { heartbeat_ = heartbeat; }

  RobotState state() const;
  double time_s() const { return time_s_; }
  bool moving() const override { return arm_.moving(); }
  /// When the arm last came to rest, s; nothing while it moves or if it never moved.
  std::optional<double> rest_since_s() const { return rest_since_s_; }
  const std::string& script_error() const { return script_error_; }

 private:
  void start_motion(const std::string& command, const std::vector<UrValue>& arguments,
                    const std::map<std::string, double>& named) override;
  UrValue call(const std::string& name, const std::vector<UrValue>& arguments) override;
  void start_script(const std::string& text);
  void stop(SafetyMode mode);
  void end_program();

  RobotModel model_;
  RobotTool tool_;
  VirtualArm arm_;
  std::set<RobotFault> faults_;
  std::multimap<double, RobotFault> coming_faults_;
  std::optional<UrScript> script_;
  std::string script_error_;
  std::vector<double> script_delays_s_ = {0};
  std::multimap<double, std::string> waiting_scripts_;  ///< by start time, s
  RobotMode mode_ = RobotMode::running;
  SafetyMode safety_ = SafetyMode::normal;
  double time_s_ = 0;
  double stopped_at_s_ = 0;
  std::optional<double> brake_at_s_;
  std::optional<double> rest_since_s_;
  Heartbeat heartbeat_;                    ///< input registers 24 to 26
  std::array<std::int32_t, 4> outputs_{};  ///< output registers 0 to 3
};

}  // namespace helicarm::robot
