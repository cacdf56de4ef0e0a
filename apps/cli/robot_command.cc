// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <limits>
#include <mutex>
#include <optional>

#include <fmt/format.h>

#include "command_line.h"
#include "helicarm/core/json.h"
#include "helicarm/core/text.h"
#include "helicarm/devices/robot/robot_driver.h"
#include "helicarm/devices/robot/robot_registry.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "stop_signal.h"

namespace helicarm::cli {

struct RobotWatchArguments {
  robot::RobotAddress robot = {.rate_hz = 10, .reads_only = true};
  std::optional<double> seconds;  ///< empty: until interrupted
};

namespace {

/// What the client's thread has received.
struct Received {
  std::mutex mutex;
  std::optional<robot::ControllerVersion> version;
  std::optional<robot::RobotState> state;
  std::uint64_t states = 0;
  std::string trouble;
};

std::string words_of(const robot::ControllerVersion& version) {
  return fmt::format("{}.{}.{}.{}", version.major, version.minor, version.bugfix, version.build);
}

std::string words_of(const robot::RobotState& state) {
  const Eigen::Vector3d& tip = state.base_from_tcp.translation;
  const auto stopped = robot::why_stopped(state);
  return fmt::format("{:10.3f} s  {}  {}  TCP {:8.2f} {:8.2f} {:8.2f} mm  payload {:.2f} kg  {}",
                     state.time_s, name(state.robot_mode), name(state.safety_mode), tip.x(), tip.y(), tip.z(),
                     state.payload_kg, stopped ? without_control_characters(stopped->message) : "may move");
}

std::string line_of(Received& received) {
  const std::lock_guard lock(received.mutex);
  if (received.state) return words_of(*received.state);
  return "no state received" + (received.trouble.empty() ? "" : ": " + received.trouble);
}

}  // namespace

/// Prints a robot's state. It reads only: nothing is written to the robot, which another program may command.
CommandResult robot_watch_command(const RobotWatchArguments& arguments, Console& console) {
  return guarded([&] {
    StopSignal interrupt;
    Received received;
    {
      const auto driver = robot::open_driver(arguments.robot);
      driver->start({[&](const robot::ControllerVersion& version) {
                       const std::lock_guard lock(received.mutex);
                       received.version = version;
                     },
                     [&](const robot::RobotState& state) {
                       const std::lock_guard lock(received.mutex);
                       received.state = state;
                       ++received.states;
                       return robot::Heartbeat{};
                     },
                     [&](const Failure& why) {
                       const std::lock_guard lock(received.mutex);
                       received.state.reset();
                       received.trouble = without_control_characters(why.message);
                     }});
      const double until =
          tracker::monotonic_seconds() + arguments.seconds.value_or(std::numeric_limits<double>::infinity());
      for (;;) {
        const double left = until - tracker::monotonic_seconds();
        if (left <= 0 || interrupt.wait(std::min(left, 1.0))) break;
        if (!console.json && !console.quiet) console.progress << line_of(received) << std::endl;
      }
    }
    if (!received.version)
      throw BadInput(Reason::not_connected,
                     fmt::format("{} port {}: {}", arguments.robot.address, arguments.robot.rtde_port,
                                 received.trouble.empty() ? "no answer" : received.trouble));
    if (console.json)
      console.out << to_text({{"version", words_of(*received.version)},
                              {"states", received.states},
                              {"trouble", received.trouble},
                              {"state", received.state ? robot::to_json(*received.state) : Json()}})
                  << '\n';
    else
      console.out << fmt::format("controller {}, {} states\n{}\n", words_of(*received.version),
                                 received.states, line_of(received));
  });
}

void add_robot(CLI::App& app, Action& action) {
  auto* robot =
      add_command(app, group::operation, "robot", "Watch a robot's state (RTDE); nothing is written to it",
                  "helicarm robot watch 192.168.7.5\n"
                  "  helicarm robot watch --seconds 2 --json");
  robot->require_subcommand(1);
  auto* watch = robot->add_subcommand("watch", "Print the robot's modes, pose and whether it may move");
  auto& a = arguments_of(watch, action, robot_watch_command);
  watch->add_option("ADDRESS", a.robot.address, "Numeric address of the robot")->capture_default_str();
  add_port(watch, "--port", a.robot.rtde_port, "Port of RTDE");
  watch->add_option("--rate", a.robot.rate_hz, "Requested states per second")
      ->check(within(1, 500))
      ->capture_default_str();
  watch->add_option("--seconds", a.seconds, "End after this time, s; default: when interrupted")
      ->check(within(0, 1e6));
}

}  // namespace helicarm::cli
