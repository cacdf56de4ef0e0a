// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operating_room/virtual_room.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace helicarm::operating_room {
namespace {

/// Real arms differ from their drawing by their factory calibration.
RobotModel arm_as_built() {
  RobotModel arm = ur5();
  arm.d1 += 0.4;
  arm.a2 -= 0.3;
  arm.a3 += 0.2;
  return arm;
}

/// In the order of TrackerFault.
constexpr std::array<std::string_view, 7> tracker_fault_words = {
    "frozen", "identity", "not_finite_poses", "time_jump", "silent", "swapped_bones", "swapped_calibrator"};

std::string hide_names(const VirtualTracker& tracker) {
  std::string names;
  for (const std::string& body : tracker.bodies()) names += (names.empty() ? "hide:" : ", hide:") + body;
  return names;
}

}  // namespace

Expected<std::unique_ptr<VirtualRoom>> VirtualRoom::open(const VirtualRoomOptions& options) {
  return guarded([&] {
    std::unique_ptr<VirtualRoom> room(new VirtualRoom);
    room->theatre_ = value_or_throw(Theatre::set_up(options.seed, options.picture_size));
    Theatre& theatre = *room->theatre_;

    VirtualUrOptions robot;
    robot.arm = arm_as_built();
    robot.tool = theatre.tool();
    robot.rtde_port = options.rtde_port;
    robot.dashboard_port = options.dashboard_port;
    robot.script_port = options.script_port;
    robot.on_notice = [notice = options.on_notice](const std::string& line) { notice("robot: " + line); };
    room->robot_ = value_or_throw(VirtualUr::start(robot));

    std::vector<FollowedBody> bodies;
    for (const char* bone : {"femur", "tibia"})
      bodies.push_back(
          {bone, simulation::marker_array(), [&theatre, bone] { return theatre.tracker_from_marker(bone); }});
    bodies.push_back({tool_marker, tool_markers(), [&theatre, robot = room->robot_.get()] {
                        return theatre.tracker_from_base() * robot->truth().base_from_tip *
                               theatre.tool().flange_from_tcp.inverse() * theatre.flange_from_marker();
                      }});
    for (const TrackedFacet& facet : calibrator_facets())
      bodies.push_back({facet.name, facet.body, [&theatre, from_facet = facet.calibrator_from_facet] {
                          return theatre.tracker_from("calibrator") * from_facet;
                        }});
    bodies.push_back(
        {pointer_marker, simulation::marker_array(), [&theatre] { return theatre.tracker_from_pointer(); }});
    VirtualTrackerOptions tracker;
    tracker.server.port = options.tracker_port;
    tracker.server.on_notice = [notice = options.on_notice](const std::string& line) {
      notice("tracker: " + line);
    };
    tracker.rate_hz = options.tracker_rate_hz;
    tracker.seed = options.seed;
    room->tracker_ = value_or_throw(VirtualTracker::start(tracker, std::move(bodies)));
    room->lift_pointer();
    return room;
  });
}

RigidTransform VirtualRoom::tracker_from_tip() {
  return theatre_->tracker_from_base() * robot_->truth().base_from_tip;
}

Expected<void> VirtualRoom::set_fault(const std::string& name, bool on) {
  constexpr std::string_view hide = "hide:";
  const auto unknown = [&](const std::string& among) {
    return fail(Reason::bad_value, fmt::format("\"{}\": must be one of {}", name, among));
  };
  if (name.starts_with(hide)) {
    const std::string body = name.substr(hide.size());
    if (!tracker_->hide(body, on)) return unknown(hide_names(*tracker_));
    return {};
  }
  const auto of_tracker = std::ranges::find(tracker_fault_words, name);
  if (of_tracker != tracker_fault_words.end()) {
    tracker_->set(static_cast<TrackerFault>(of_tracker - tracker_fault_words.begin()), on);
    return {};
  }
  const auto fault = robot_fault(name);
  if (!fault) return unknown(room_fault_names());
  robot_->set(*fault, on);
  return {};
}

void VirtualRoom::touch(const std::string& bone) {
  theatre_->touch(bone);
  tracker_->hide(pointer_marker, false);
}

void VirtualRoom::lift_pointer() { tracker_->hide(pointer_marker, true); }

std::string VirtualRoom::power_on() {
  return fmt::format("{}; {}", robot_->dashboard("power on"), robot_->dashboard("brake release"));
}

std::string room_fault_names() {
  return fmt::format("hide:BODY, {}, {}", fmt::join(tracker_fault_words, ", "), robot_fault_names());
}

}  // namespace helicarm::operating_room
