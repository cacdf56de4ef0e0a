// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operating_room/virtual_room.h"

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

std::optional<TrackerFault> tracker_fault(const std::string& name) {
  if (name == "frozen") return TrackerFault::frozen;
  if (name == "identity") return TrackerFault::identity;
  if (name == "not_finite_poses") return TrackerFault::not_finite;
  if (name == "time_jump") return TrackerFault::time_jump;
  if (name == "silent") return TrackerFault::silent;
  return {};
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
    room->robot_ = value_or_throw(VirtualUr::start(robot));

    std::vector<FollowedBody> bodies;
    for (const char* bone : {"femur", "tibia"})
      bodies.push_back(
          {bone, simulation::marker_array(), [&theatre, bone] { return theatre.tracker_from(bone); }});
    bodies.push_back({tool_marker, tool_markers(), [&theatre, robot = room->robot_.get()] {
                        return theatre.tracker_from_base() * robot->truth().base_from_tip *
                               theatre.tool().flange_from_tcp.inverse() * theatre.flange_from_marker();
                      }});
    for (const TrackedFacet& facet : calibrator_facets())
      bodies.push_back({facet.name, facet.body, [&theatre, from_facet = facet.calibrator_from_facet] {
                          return theatre.tracker_from("calibrator") * from_facet;
                        }});
    VirtualTrackerOptions tracker;
    tracker.server.port = options.tracker_port;
    tracker.rate_hz = options.tracker_rate_hz;
    tracker.seed = options.seed;
    room->tracker_ = value_or_throw(VirtualTracker::start(tracker, std::move(bodies)));
    return room;
  });
}

RigidTransform VirtualRoom::tracker_from_tip() {
  return theatre_->tracker_from_base() * robot_->truth().base_from_tip;
}

Expected<void> VirtualRoom::set_fault(const std::string& name, bool on) {
  constexpr std::string_view hide = "hide:";
  if (name.starts_with(hide)) {
    tracker_->hide(name.substr(hide.size()), on);
    return {};
  }
  if (const auto fault = tracker_fault(name)) {
    tracker_->set(*fault, on);
    return {};
  }
  const auto fault = robot_fault(name);
  if (!fault) return tl::unexpected<Failure>(fault.error());
  robot_->set(*fault, on);
  return {};
}

}  // namespace helicarm::operating_room
