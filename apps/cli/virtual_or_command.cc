// SPDX-License-Identifier: Apache-2.0
#include "virtual_or_command.h"

#include <iostream>
#include <sstream>
#include <thread>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include "helicarm/core/files.h"
#include "helicarm/core/text.h"
#include "helicarm/rehearsal/rehearse.h"
#include "stop_signal.h"

namespace helicarm::cli {
namespace {

using operating_room::VirtualRoom;

constexpr const char* words =
    "shoot VIEW | shoot VIEW wrong_title|breaks_off|same_picture|other_patient | fault NAME on|off | "
    "move femur|tibia X Y Z (mm) | where | quit";

operating_room::CArmFault c_arm_fault(const std::string& name) {
  using operating_room::CArmFault;
  if (name.empty()) return CArmFault::none;
  if (name == "wrong_title") return CArmFault::wrong_title;
  if (name == "breaks_off") return CArmFault::breaks_off;
  if (name == "same_picture") return CArmFault::same_picture;
  if (name == "other_patient") return CArmFault::other_patient;
  throw BadInput(Reason::usage, "no such fault of the C-arm");
}

/// Does what one line says and answers with one; throws BadInput.
std::string obey(const std::string& line, VirtualRoom& room,
                 const operating_room::PictureReceiver& receiver) {
  std::istringstream said(line);
  std::string verb, what, how;
  said >> verb >> what;
  if (verb == "shoot") {
    said >> how;
    value_or_throw(operating_room::shoot(room.theatre(), what, receiver, c_arm_fault(how)));
    return "shot " + what;
  }
  if (verb == "fault") {
    said >> how;
    if (how != "on" && how != "off") throw BadInput(Reason::usage, "fault NAME on or off");
    value_or_throw(room.set_fault(what, how == "on"));
    return fmt::format("{} {}", what, how);
  }
  if (verb == "move") {
    Eigen::Vector3d shift;
    if (!(said >> shift.x() >> shift.y() >> shift.z()) || (what != "femur" && what != "tibia"))
      throw BadInput(Reason::usage, "move femur|tibia X Y Z");
    room.theatre().move_bone(what, {Eigen::Matrix3d::Identity(), shift});
    return "moved " + what;
  }
  if (verb == "where") {
    const Eigen::Vector3d tip = room.tracker_from_tip().translation;
    const VirtualTruth robot = room.robot().truth();
    const std::string motion =
        robot.moving         ? "moving"
        : robot.rest_since_s ? fmt::format("at rest for {:.3f} s", robot.state.time_s - *robot.rest_since_s)
                             : "never moved";
    return fmt::format("tip {:.3f} {:.3f} {:.3f}, {}", tip.x(), tip.y(), tip.z(), motion);
  }
  throw BadInput(Reason::usage, std::string("words are: ") + words);
}

/// Until its input ends, "quit", or the stop token.
void listen(const std::stop_token& stop, VirtualRoom& room, const VirtualOrArguments& arguments,
            Console& console, StopSignal& end) {
  std::string line;
  while (!stop.stop_requested()) {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    constexpr int look_again_ms = 100;
    if (::poll(&input, 1, look_again_ms) <= 0) continue;
    if (!std::getline(std::cin, line)) return;
    if (line == "quit") return end.raise();
    if (line.empty()) continue;
    const auto answer = guarded([&] { return obey(line, room, arguments.receiver); });
    if (answer)
      console.out << *answer << std::endl;
    else
      console.out << fmt::format("{}: {}", code(answer.error().reason),
                                 without_control_characters(answer.error().message))
                  << std::endl;
  }
}

}  // namespace

CommandResult virtual_or_command(const VirtualOrArguments& arguments, Console& console) {
  return guarded([&] {
    StopSignal end;
    operating_room::VirtualRoomOptions options = arguments.room;
    options.seed = console.seed;
    const auto room = value_or_throw(VirtualRoom::open(options));
    if (!arguments.plan.empty())
      value_or_throw(write_file(arguments.plan, to_text(to_json(plan_for(*room, room->tracker().port())))));
    if (!console.quiet)
      console.progress << fmt::format(
                              "tracker (OpenIGTLink) port {}\nrobot (UR5): RTDE {}, dashboard {}, script {}\n"
                              "C-arm sends to {} {} port {}\nsay: {}\n",
                              room->tracker().port(), room->robot().rtde_port(),
                              room->robot().dashboard_port(), room->robot().script_port(),
                              arguments.receiver.title, arguments.receiver.address, arguments.receiver.port,
                              words)
                       << std::flush;
    const std::jthread listener(
        [&](const std::stop_token& stop) { listen(stop, *room, arguments, console, end); });
    end.wait(arguments.seconds);
  });
}

}  // namespace helicarm::cli
