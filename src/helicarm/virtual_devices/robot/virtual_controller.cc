// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/virtual_controller.h"

#include <algorithm>
#include <array>
#include <limits>

#include <fmt/format.h>

namespace helicarm::robot {
namespace {

constexpr std::array<std::string_view, 20> fault_names = {
    "emergency_stop",     "protective_stop", "safeguard_stop", "violation",   "local_mode",
    "brake_not_released", "zero_speed",      "moved_by_hand",  "other_tool",  "clock_jump",
    "frozen_states",      "cut_cable",       "half_packet",    "huge_packet", "wrong_version",
    "unknown_output",     "input_in_use",    "not_finite",     "late_script", "script_twice"};

// UR5 user manual 5.3: braking begins within 24 ms and ends within 500 ms from full speed.
constexpr double brake_delay_s = 0.024;
constexpr double safety_stop_rad_s2 = 3.1416 / (0.5 - brake_delay_s);
// Earliest release of a protective stop.
constexpr double unlock_after_s = 5;
// Deceleration when a program ends: the controller's default.
constexpr double end_rad_s2 = 10;
/// Delay of a late script: longer than the heartbeat limit, shorter than its sender's timeout.
constexpr double late_script_s = 0.3;

UrPose six(const UrValue& value) {
  if (value.size() != 6) throw BadInput(Reason::bad_value, "expected six numbers");
  return Eigen::Map<const UrPose>(value.data());
}

double one(const UrValue& value) {
  if (value.size() != 1) throw BadInput(Reason::bad_value, "expected a number");
  return value[0];
}

std::int32_t register_value(const UrValue& value) {
  constexpr double least = std::numeric_limits<std::int32_t>::min(),
                   most = std::numeric_limits<std::int32_t>::max();
  const double number = one(value);
  if (!(number >= least && number <= most))
    throw BadInput(Reason::bad_value, "a register holds whole numbers of 32 bits");
  return static_cast<std::int32_t>(number);
}

double named_or(const std::map<std::string, double>& named, const char* name, double fallback) {
  const auto found = named.find(name);
  const double value = found == named.end() ? fallback : found->second;
  if (!(value > 0 && value < 100)) throw BadInput(Reason::bad_value, std::string(name) + " is out of range");
  return value;
}

std::uint32_t bits_of(SafetyMode mode) {
  switch (mode) {
    case SafetyMode::normal:
      return 1;
    case SafetyMode::protective_stop:
      return 1u << 2 | 1u << 10;
    case SafetyMode::safeguard_stop:
      return 1u << 4 | 1u << 10;
    case SafetyMode::robot_emergency_stop:
      return 1u << 6 | 1u << 7 | 1u << 10;
    case SafetyMode::violation:
      return 1u << 8 | 1u << 10;
    default:
      return 1u << 9;
  }
}

/// Commands of the dashboard that change nothing here, with a real controller's answers.
std::optional<std::string_view> answer_without_effect(std::string_view command) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 12> answers = {
      {{"close safety popup", "closing safety popup"},
       {"close popup", "closing popup"},
       {"get loaded program", "No program loaded"},
       {"is program saved", "true <unnamed>"},
       {"get operational mode", "NONE"},
       {"get serial number", "20260000001"},
       {"clear operational mode",
        "No longer controlling the operational mode. Current operational mode: "
        "'NONE'."},
       {"play", "Failed to execute: play"},
       {"pause", "Failed to execute: pause"},
       {"quit", "Disconnected"},
       {"version", "helicarm virtual robot"},
       {"get user role", "PROGRAMMER"}}};
  if (command.starts_with("popup ")) return "showing popup";
  if (command.starts_with("addToLog ")) return "Added log message";
  const auto found =
      std::ranges::find(answers, command, &std::pair<std::string_view, std::string_view>::first);
  return found == answers.end() ? std::nullopt : std::optional(found->second);
}

}  // namespace

Expected<RobotFault> robot_fault(const std::string& name) {
  for (std::size_t i = 0; i < fault_names.size(); ++i)
    if (fault_names[i] == name) return static_cast<RobotFault>(i);
  return fail(Reason::bad_value, fmt::format("a robot's fault is one of {}", robot_fault_names()));
}

std::string robot_fault_names() { return fmt::format("{}", fmt::join(fault_names, ", ")); }

VirtualController::VirtualController(const RobotModel& model, const RobotTool& tool, const Joints& joints)
    : model_(model), tool_(tool), arm_(model, joints) {}

void VirtualController::end_program() {
  script_.reset();
  if (arm_.moving() && !brake_at_s_) arm_.brake(end_rad_s2);
}

void VirtualController::stop(SafetyMode mode) {
  script_.reset();
  safety_ = mode;
  stopped_at_s_ = time_s_;
  brake_at_s_ = time_s_ + brake_delay_s;
}

void VirtualController::step() {
  const double period_s = 1 / model_.rate_hz;
  time_s_ += period_s;
  while (!coming_faults_.empty() && coming_faults_.begin()->first <= time_s_)
    set(coming_faults_.extract(coming_faults_.begin()).mapped(), true);
  while (!waiting_scripts_.empty() && waiting_scripts_.begin()->first <= time_s_)
    start_script(waiting_scripts_.extract(waiting_scripts_.begin()).mapped());
  if (script_) {
    const auto runs = script_->step(*this);
    if (!runs) script_error_ = runs.error().message;
    if (!runs && runs.error().reason == Reason::out_of_reach)
      stop(SafetyMode::protective_stop);
    else if (!runs || !*runs)
      end_program();
  }
  if (brake_at_s_ && time_s_ >= *brake_at_s_) {
    brake_at_s_.reset();
    if (arm_.moving()) arm_.brake(safety_stop_rad_s2);
  }
  const bool moved = arm_.moving();
  if (!arm_.step(period_s, has(RobotFault::zero_speed) ? 0 : 1)) {
    stop(SafetyMode::protective_stop);
    arm_.brake(safety_stop_rad_s2);
  }
  if (moved && !arm_.moving())
    rest_since_s_ = time_s_;
  else if (arm_.moving())
    rest_since_s_.reset();
}

void VirtualController::set(RobotFault fault, bool on) {
  if (!on) {
    faults_.erase(fault);
    if (fault == RobotFault::late_script || fault == RobotFault::script_twice) script_delays_s_ = {0};
    if (fault == RobotFault::emergency_stop && safety_ == SafetyMode::robot_emergency_stop) {
      safety_ = SafetyMode::normal;  // the button is released, but the arm has no power
      mode_ = RobotMode::power_off;
    }
    if (fault == RobotFault::safeguard_stop && safety_ == SafetyMode::safeguard_stop)
      safety_ = SafetyMode::normal;
    return;
  }
  faults_.insert(fault);
  switch (fault) {
    case RobotFault::emergency_stop:
      return stop(SafetyMode::robot_emergency_stop);
    case RobotFault::protective_stop:
      return stop(SafetyMode::protective_stop);
    case RobotFault::safeguard_stop:
      return stop(SafetyMode::safeguard_stop);
    case RobotFault::violation:
      return stop(SafetyMode::violation);
    case RobotFault::brake_not_released:
      mode_ = RobotMode::idle;
      return end_program();
    case RobotFault::moved_by_hand:
      return arm_.push(Joints::Unit(0) * 0.02);
    case RobotFault::late_script:
      return delay_scripts({late_script_s});
    case RobotFault::script_twice:
      return delay_scripts({0, late_script_s});
    case RobotFault::clock_jump:
      time_s_ = 0;
      return;
    default:
      return;
  }
}

void VirtualController::run_script(const std::string& text) {
  for (const double delay_s : script_delays_s_)
    if (delay_s > 0)
      waiting_scripts_.emplace(time_s_ + delay_s, text);
    else
      start_script(text);
}

void VirtualController::start_script(const std::string& text) {
  if (has(RobotFault::local_mode)) return;
  end_program();
  auto script = UrScript::parse(text);
  if (!script)
    script_error_ = script.error().message;
  else if (mode_ == RobotMode::running && safety_ == SafetyMode::normal)
    script_ = *std::move(script);
}

std::string VirtualController::dashboard(std::string_view command) {
  if (command == "robotmode") return fmt::format("Robotmode: {}", name(mode_));
  if (command == "safetymode" || command == "safetystatus")
    return fmt::format("{}: {}", command == "safetymode" ? "Safetymode" : "Safetystatus", name(safety_));
  if (command == "programState") return script_ ? "PLAYING helicarm" : "STOPPED helicarm";
  if (command == "running") return fmt::format("Program running: {}", script_.has_value());
  if (command == "is in remote control") return has(RobotFault::local_mode) ? "false" : "true";
  if (command == "PolyscopeVersion") return fmt::format("URSoftware {} (virtual)", fmt::join(version(), "."));
  if (const auto answer = answer_without_effect(command)) return std::string(*answer);
  if (command == "get robot model") return model_.name;
  if (command.starts_with("load ")) return fmt::format("File not found: {}", command.substr(5, 100));
  if (command == "stop") {
    end_program();
    return "Stopped";
  }
  if (has(RobotFault::local_mode)) return "Command is not allowed: not in remote control";
  if (command == "unlock protective stop") {
    if (safety_ == SafetyMode::protective_stop) {
      if (time_s_ - stopped_at_s_ < unlock_after_s)
        return "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective "
               "stop before unlocking";
      safety_ = SafetyMode::normal;
    }
    return "Protective stop releasing";
  }
  if (command == "restart safety") {
    if (safety_ == SafetyMode::violation) {
      safety_ = SafetyMode::normal;
      mode_ = RobotMode::power_off;
    }
    return "Restarting safety";
  }
  if (command == "power off") {
    end_program();
    if (mode_ >= RobotMode::power_on) mode_ = RobotMode::power_off;
    return "Powering off";
  }
  if (command == "power on") {
    if (mode_ == RobotMode::power_off) mode_ = RobotMode::idle;
    return "Powering on";
  }
  if (command == "brake release") {
    if (!has(RobotFault::brake_not_released)) mode_ = RobotMode::running;
    return "Brake releasing";
  }
  return fmt::format("could not understand: '{}'", command.substr(0, 100));
}

std::array<std::uint32_t, 4> VirtualController::version() const {
  const bool cb3 = model_.rate_hz < 200;
  return cb3 ? std::array{3u, 15u, 8u, 0u} : std::array{5u, 25u, 1u, 0u};
}

void VirtualController::start_motion(const std::string& command, const std::vector<UrValue>& arguments,
                                     const std::map<std::string, double>& named) {
  if (arguments.size() != 1) throw BadInput(Reason::bad_value, command + ": expected one pose");
  if (command == "stopj") return arm_.brake(std::clamp(one(arguments[0]), 0.1, 40.0));
  if (command == "movej")
    return arm_.move_joints(six(arguments[0]), named_or(named, "v", 1.05), named_or(named, "a", 1.4));
  const auto going =
      arm_.move_linear(transform_from(six(arguments[0])), tool_.flange_from_tcp,
                       named_or(named, "v", 0.25) * mm_per_m, named_or(named, "a", 1.2) * mm_per_m);
  value_or_throw(going);
}

UrValue VirtualController::call(const std::string& name, const std::vector<UrValue>& arguments) {
  const auto expect = [&](std::size_t count) {
    if (arguments.size() != count) throw BadInput(Reason::bad_value, name + ": wrong number of arguments");
  };
  const auto place = [&](double first, std::size_t count) {
    const double index = one(arguments[0]) - first;
    if (!(index >= 0 && index < static_cast<double>(count)))
      throw BadInput(Reason::unsupported, name + ": register not used by helicarm's robot scripts");
    return static_cast<std::size_t>(index);
  };
  if (name == "set_tcp") {
    expect(1);
    tool_.flange_from_tcp = transform_from(six(arguments[0]));
  } else if (name == "set_payload") {
    expect(1);
    tool_.payload_kg = one(arguments[0]);
  } else if (name == "read_input_integer_register") {
    expect(1);
    const std::array<std::int32_t, 3> inputs = {heartbeat_.beat, heartbeat_.order.session,
                                                heartbeat_.order.count};
    return {double(inputs.at(place(24, inputs.size())))};
  } else if (name == "read_output_integer_register") {
    expect(1);
    return {double(outputs_.at(place(0, outputs_.size())))};
  } else if (name == "write_output_integer_register") {
    expect(2);
    outputs_.at(place(0, outputs_.size())) = register_value(arguments[1]);
  } else {
    throw BadInput(Reason::unsupported, "function " + name + " is not defined");
  }
  return {};
}

RobotState VirtualController::state() const {
  RobotState state;
  state.time_s = has(RobotFault::not_finite) ? std::nan("") : time_s_;
  state.joints = arm_.joints();
  state.joint_speeds = arm_.joint_speeds();
  state.flange_from_tcp = tool_.flange_from_tcp;
  if (has(RobotFault::other_tool)) state.flange_from_tcp.translation.z() += 5;
  state.base_from_tcp = base_from_flange(model_, state.joints) * state.flange_from_tcp;
  state.payload_kg = tool_.payload_kg;
  state.robot_mode = mode_;
  state.safety_mode = safety_;
  state.safety_bits = bits_of(safety_);
  state.runtime = script_ ? RuntimeState::playing : RuntimeState::stopped;
  state.speed_scaling = has(RobotFault::zero_speed) ? 0 : 1;
  state.script = {static_cast<ScriptStage>(outputs_[0]), {outputs_[1], outputs_[2]}, outputs_[3]};
  return state;
}

}  // namespace helicarm::robot
