// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/virtual_devices.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace helicarm::virtual_devices {
namespace {

/// Real arms differ from the nominal model by their factory calibration.
robot::RobotModel arm_as_built() {
  robot::RobotModel arm = robot::ur5();
  arm.d1 += 0.4;
  arm.a2 -= 0.3;
  arm.a3 += 0.2;
  return arm;
}

robot::VirtualUrOptions robot_options(const VirtualDevicesOptions& options, const SimulatedScene& scene) {
  robot::VirtualUrOptions robot;
  robot.arm = arm_as_built();
  robot.tool = scene.tool();
  robot.rtde_port = options.rtde_port;
  robot.dashboard_port = options.dashboard_port;
  robot.script_port = options.script_port;
  robot.primary_port = options.primary_port;
  robot.on_notice = [notice = options.on_notice](const std::string& line) { notice("robot: " + line); };
  return robot;
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

Expected<std::unique_ptr<VirtualDevices>> VirtualDevices::open(const VirtualDevicesOptions& options) {
  return guarded([&] {
    std::unique_ptr<VirtualDevices> virtual_or(new VirtualDevices);
    virtual_or->simulated_scene_ =
        value_or_throw(SimulatedScene::set_up(options.seed, options.image_size, options.ct));
    SimulatedScene& simulated_scene = *virtual_or->simulated_scene_;

    if (options.freehand)
      virtual_or->drill_ = std::make_unique<HeldDrill>(simulated_scene, options.seed);
    else
      virtual_or->robot_ = value_or_throw(robot::VirtualUr::start(robot_options(options, simulated_scene)));

    std::vector<FollowedBody> bodies;
    for (const char* bone : {"femur", "tibia"})
      bodies.push_back({bone, simulation::marker_array(),
                        [&simulated_scene, bone] { return simulated_scene.tracker_from_marker(bone); }});
    bodies.push_back({tool_marker, tool_markers(), [&devices = *virtual_or] {
                        const SimulatedScene& scene = *devices.simulated_scene_;
                        return devices.tracker_from_tip() * scene.tool().flange_from_tcp.inverse() *
                               scene.flange_from_marker();
                      }});
    for (const TrackedFacet& facet : calibrator_facets())
      bodies.push_back({facet.name, facet.body, [&simulated_scene, from_facet = facet.calibrator_from_facet] {
                          return simulated_scene.tracker_from("calibrator") * from_facet;
                        }});
    bodies.push_back({pointer_marker, simulation::marker_array(),
                      [&simulated_scene] { return simulated_scene.tracker_from_pointer(); }});
    VirtualTrackerOptions tracker;
    tracker.server.port = options.tracker_port;
    tracker.server.on_notice = [notice = options.on_notice](const std::string& line) {
      notice("tracker: " + line);
    };
    tracker.ndi = options.ndi_tracker;
    tracker.rate_hz = options.tracker_rate_hz;
    tracker.seed = options.seed;
    virtual_or->tracker_ = value_or_throw(VirtualTracker::start(tracker, std::move(bodies)));
    virtual_or->lift_pointer();
    return virtual_or;
  });
}

geometry::RigidTransform VirtualDevices::tracker_from_tip() {
  if (drill_) return drill_->tracker_from_tip();
  return simulated_scene_->tracker_from_base() * robot_->truth().base_from_tip;
}

Expected<void> VirtualDevices::set_fault(const std::string& name, bool on) {
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
  const auto fault = robot::robot_fault(name);
  if (!fault || !robot_) return unknown(virtual_fault_names());
  robot_->set(*fault, on);
  return {};
}

bool VirtualDevices::touch(const std::string& what) {
  if (!simulated_scene_->touch(what)) return false;
  tracker_->hide(pointer_marker, false);
  return true;
}

void VirtualDevices::lift_pointer() { tracker_->hide(pointer_marker, true); }

std::string VirtualDevices::power_on() {
  if (!robot_) throw BadInput(Reason::usage, "there is no robot");
  return fmt::format("{}; {}", robot_->dashboard("power on"), robot_->dashboard("brake release"));
}

std::string virtual_fault_names() {
  return fmt::format("hide:BODY, {}, {}", fmt::join(tracker_fault_words, ", "), robot::robot_fault_names());
}

}  // namespace helicarm::virtual_devices
