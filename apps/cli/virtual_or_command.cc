// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <mutex>
#include <numbers>
#include <optional>
#include <sstream>
#include <thread>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <unistd.h>

#include "command_line.h"
#include "helicarm/core/files.h"
#include "helicarm/core/text.h"
#include "helicarm/rehearsal/rehearse.h"
#include "helicarm/virtual_devices/virtual_devices.h"
#include "helicarm/virtual_devices/virtual_devices_fields.h"
#include "line_input.h"
#include "simulated_ct.h"
#include "stop_signal.h"

namespace helicarm::cli {

struct VirtualOrArguments {
  virtual_devices::VirtualDevicesOptions virtual_or;
  virtual_devices::ImageReceiver receiver;
  std::filesystem::path plan;  ///< written for `navigate`; empty: none
  bool check_points = false;   ///< in the plan
  std::optional<double> seconds;
  CtArguments ct;
};

namespace {

using virtual_devices::VirtualDevices;

/// Five times the difference of two touches due to the virtual tracker's drift.
constexpr double notch_limit_mm = 1.5;

std::string words() {
  return fmt::format(
      "shoot VIEW | shoot VIEW {} | fault NAME on|off ({}) | move femur|tibia|base X Y Z (mm) | turn "
      "femur|tibia DEG (about its tunnel's outer end) | bump femur|tibia X Y Z (mm: its marker) | touch "
      "femur|tibia|nothing|BALL (P1 ..) | drill femur|tibia DEPTH [OFF_MM [TILT_DEG]] (of a hand-held drill) "
      "| power on | "
      "where | quit",
      virtual_devices::c_arm_fault_names(), virtual_devices::virtual_fault_names());
}

virtual_devices::CArmFault fault_of_shot(const std::string& name) {
  if (name.empty()) return virtual_devices::CArmFault::none;
  if (const auto fault = virtual_devices::c_arm_fault(name)) return *fault;
  throw BadInput(Reason::bad_value,
                 fmt::format("a fault of the C-arm is one of {}", virtual_devices::c_arm_fault_names()));
}

std::string motion_of_tool(VirtualDevices& virtual_or) {
  if (!virtual_or.robot_if_any()) return "held by hand";
  const robot::VirtualTruth robot = virtual_or.robot().truth();
  if (robot.moving) return "moving";
  return robot.rest_since_s ? fmt::format("at rest for {:.3f} s", robot.state.time_s - *robot.rest_since_s)
                            : "never moved";
}

std::string ports_of(VirtualDevices& virtual_or) {
  if (!virtual_or.robot_if_any()) return "drill: held by hand, no robot";
  const robot::VirtualUr& robot = virtual_or.robot();
  return fmt::format("robot (UR5): RTDE {}, dashboard {}, script {}, primary {}", robot.rtde_port(),
                     robot.dashboard_port(), robot.script_port(), robot.primary_port());
}

/// Executes one command line and returns the answer; throws BadInput.
std::string execute(const std::string& line, VirtualDevices& virtual_or,
                    const virtual_devices::ImageReceiver& receiver) {
  std::istringstream said(line);
  std::string verb, what, state;
  said >> verb >> what;
  if (verb == "shoot") {
    said >> state;
    value_or_throw(
        virtual_devices::shoot(virtual_or.simulated_scene(), what, receiver, fault_of_shot(state)));
    return "shot " + what;
  }
  if (verb == "fault") {
    said >> state;
    if (state != "on" && state != "off") throw BadInput(Reason::usage, "fault NAME on or off");
    value_or_throw(virtual_or.set_fault(what, state == "on"));
    return fmt::format("{} {}", what, state);
  }
  const bool bone = what == "femur" || what == "tibia";
  if (verb == "move" || verb == "bump") {
    Eigen::Vector3d shift;
    const bool base = verb == "move" && what == "base";
    if (!(said >> shift.x() >> shift.y() >> shift.z()) || !(bone || base))
      throw BadInput(Reason::usage, verb + " femur|tibia X Y Z");
    if (verb == "bump")
      virtual_or.simulated_scene().bump_marker(what, shift);
    else if (base)
      virtual_or.simulated_scene().move_base(shift);
    else
      virtual_or.simulated_scene().move_bone(what, {Eigen::Matrix3d::Identity(), shift});
    return (verb == "bump" ? "bumped " : "moved ") + what;
  }
  if (verb == "turn") {
    double degrees = 0;
    if (!(said >> degrees) || !bone) throw BadInput(Reason::usage, "turn femur|tibia DEG");
    virtual_or.simulated_scene().turn_bone(
        what, virtual_or.simulated_scene().point_in_tracker(what == "femur" ? "FE" : "TS"),
        Eigen::AngleAxisd(degrees * std::numbers::pi / 180, Eigen::Vector3d::UnitX()).toRotationMatrix());
    return "turned " + what;
  }
  if (verb == "touch") {
    if (what == "nothing")
      virtual_or.lift_pointer();
    else if (!virtual_or.touch(what))
      throw BadInput(Reason::usage, "touch femur|tibia|nothing, or the label of a ball");
    return "touching " + what;
  }
  if (verb == "drill") {
    double depth = 0, off = 0, tilt = 0;
    if (!(said >> depth) || !bone || virtual_or.robot_if_any())
      throw BadInput(Reason::usage, "drill femur|tibia DEPTH [OFF_MM [TILT_DEG]], with --freehand");
    said >> off >> tilt;
    constexpr double drill_s = 3;
    virtual_or.drill().move(what, virtual_or.drill().on_tunnel(what, depth, off, tilt), drill_s);
    return "drilling " + what;
  }
  if (verb == "power") {
    if (what != "on") throw BadInput(Reason::usage, "power on");
    return virtual_or.power_on();
  }
  if (verb == "where") {
    const Eigen::Vector3d tip = virtual_or.tracker_from_tip().translation;
    return fmt::format("tip {:.3f} {:.3f} {:.3f}, {}", tip.x(), tip.y(), tip.z(), motion_of_tool(virtual_or));
  }
  throw BadInput(Reason::usage, "commands: " + words());
}

/// Reads commands until the input ends, "quit", or a stop request.
void listen(const std::stop_token& stop, VirtualDevices& virtual_or, const VirtualOrArguments& arguments,
            Console& console, StopSignal& end) {
  constexpr int look_again_ms = 100;
  LineInput input(STDIN_FILENO);
  while (!stop.stop_requested()) {
    const auto line = guarded([&] { return input.next(look_again_ms); });
    if (!line) {
      if (line.error().reason != Reason::interrupted)
        console.progress << fmt::format("{}; input closed\n", line.error().message) << std::flush;
      return;
    }
    if (!*line || (*line)->empty()) continue;
    if (**line == "quit") return end.raise();
    const auto answer = guarded([&] { return execute(**line, virtual_or, arguments.receiver); });
    if (answer)
      console.out << *answer << std::endl;
    else
      console.out << fmt::format("{}: {}", code(answer.error().reason),
                                 without_control_characters(answer.error().message))
                  << std::endl;
  }
}

}  // namespace

/// A virtual C-arm, tracker and robot on their ports; commands on standard input acquire images, move objects
/// and inject faults.
CommandResult virtual_or_command(const VirtualOrArguments& arguments, Console& console) {
  return guarded([&] {
    StopSignal end;
    virtual_devices::VirtualDevicesOptions options = arguments.virtual_or;
    options.seed = console.seed;
    options.ct = ct_from(arguments.ct, console);
    std::mutex telling;
    options.on_notice = [&](const std::string& line) {
      const std::lock_guard lock(telling);
      if (!console.quiet) console.progress << line + "\n" << std::flush;
    };
    const auto virtual_or = value_or_throw(VirtualDevices::open(options));
    if (!arguments.plan.empty()) {
      operation::OperationPlan plan = rehearsal::plan_for(*virtual_or, virtual_or->tracker().port());
      if (arguments.check_points)
        plan.check_points = {{"femur notch", "femur", notch_limit_mm},
                             {"tibia notch", "tibia", notch_limit_mm}};
      if (options.ct) plan.picks.clear(), plan.tunnels.clear();  // the knee's; a model's take their place
      value_or_throw(write_file(arguments.plan, to_text(operation::to_json(plan))));
    }
    if (!console.quiet)
      console.progress << fmt::format(
                              "tracker ({}) port {}\n{}\n"
                              "C-arm sends to {} {} port {}\ncommands: {}\n",
                              virtual_or->tracker().speaks_ndi() ? "NDI" : "OpenIGTLink",
                              virtual_or->tracker().port(), ports_of(*virtual_or), arguments.receiver.title,
                              arguments.receiver.address, arguments.receiver.port, words())
                       << std::flush;
    const std::jthread listener(
        [&](const std::stop_token& stop) { listen(stop, *virtual_or, arguments, console, end); });
    end.wait(arguments.seconds);
  });
}

void add_virtual_or(CLI::App& app, Action& action) {
  auto* command =
      add_command(app, group::operation, "virtual-or",
                  "Virtual C-arm, tracker and robot on the protocols of the real ones",
                  "helicarm virtual-or --plan plan.json\n"
                  "  (then type: shoot AP, shoot LAT, fault hide:femur on, fault cut_cable on, where, quit)");
  auto& a = arguments_of(command, action, virtual_or_command);
  command->add_option("--plan", a.plan, "Write a plan for navigate, with simulated picks");
  command->add_flag("--check-points", a.check_points, "The plan requires a check point on each bone");
  command->add_flag(
      "--freehand", a.virtual_or.freehand,
      "A person holds the drill; there is no robot, and the plan is one for freehand navigation");
  add_ct(*command, a.ct);
  add_fields(command, a.virtual_or, virtual_devices::virtual_devices_fields);
  add_port(command, "--tracker-port", a.virtual_or.tracker_port,
           "Port of the tracker; 0: a free port, as for the ports below");
  command->add_flag("--ndi", a.virtual_or.ndi_tracker,
                    "The tracker speaks NDI's API (as a Polaris) in place of OpenIGTLink");
  add_port(command, "--rtde-port", a.virtual_or.rtde_port, "of the robot");
  add_port(command, "--dashboard-port", a.virtual_or.dashboard_port, "of the robot");
  add_port(command, "--script-port", a.virtual_or.script_port, "of the robot");
  a.virtual_or.primary_port = 30001;
  add_port(command, "--primary-port", a.virtual_or.primary_port, "of the robot");
  add_port(command, "--receiver-port", a.receiver.port, "Port to which the C-arm sends its images");
  command->add_option("--receiver-title", a.receiver.title, "Application entity title of the receiver")
      ->capture_default_str();
  command->add_option("--seconds", a.seconds, "End after this time")->check(within(0, 1e9));
}

}  // namespace helicarm::cli
