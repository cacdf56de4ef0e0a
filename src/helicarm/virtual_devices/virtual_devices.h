// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "helicarm/virtual_devices/held_drill.h"
#include "helicarm/virtual_devices/robot/virtual_ur.h"
#include "helicarm/virtual_devices/virtual_c_arm.h"
#include "helicarm/virtual_devices/virtual_tracker.h"

namespace helicarm::virtual_devices {

struct VirtualDevicesOptions {
  std::uint64_t seed = 1;
  int image_size = 1024;
  double tracker_rate_hz = 30;
  std::uint16_t tracker_port = 18944;  ///< 0 for any port: a free one is chosen
  std::uint16_t rtde_port = 30004;
  std::uint16_t dashboard_port = 29999;
  std::uint16_t script_port = 30002;
  /// Log line for each disconnected client of tracker or robot; called on their threads.
  std::function<void(const std::string&)> on_notice = [](const std::string&) {};
  bool freehand = false;  ///< a person holds the drill; there is no robot
  std::uint16_t primary_port = 0;
  bool ndi_tracker = false;  ///< the tracker speaks NDI's API in place of OpenIGTLink
  std::shared_ptr<const simulation::CtOptions> ct = {};  ///< instead of the modelled knee
};

/// A simulated scene with a running tracker and a robot or a hand-held drill; the C-arm sends by `shoot`. All
/// servers listen on the local host only.
class VirtualDevices {
 public:
  /// Refuses as `SimulatedScene::set_up`, VirtualTracker and VirtualUr.
  static Expected<std::unique_ptr<VirtualDevices>> open(const VirtualDevicesOptions& options);

  SimulatedScene& simulated_scene() { return *simulated_scene_; }
  VirtualTracker& tracker() { return *tracker_; }
  /// Null if freehand.
  robot::VirtualUr* robot_if_any() { return robot_.get(); }
  robot::VirtualUr& robot() { return *robot_; }
  /// Only if freehand.
  HeldDrill& drill() { return *drill_; }

  /// True pose of the tool's tip; z is its axis.
  geometry::RigidTransform tracker_from_tip();

  /// Switches a fault on or off by name, one of `virtual_fault_names`. An unknown one is bad_value.
  Expected<void> set_fault(const std::string& name, bool on);

  /// Holds the pointer's tip on a bone ("femur" or "tibia") or a ball of the calibrator at rest; before and
  /// after, it is not visible. Returns whether there is such a thing.
  bool touch(const std::string& what);
  void lift_pointer();

  /// Recovery at the robot after an emergency stop: power on, brakes open. Returns the robot's answers.
  /// Throws BadInput (usage) without a robot.
  std::string power_on();

 private:
  VirtualDevices() = default;

  std::unique_ptr<SimulatedScene> simulated_scene_;
  std::unique_ptr<robot::VirtualUr> robot_;
  std::unique_ptr<HeldDrill> drill_;
  std::unique_ptr<VirtualTracker> tracker_;
};

/// hide:BODY, and all faults of tracker and robot, for messages.
std::string virtual_fault_names();

/// Names of the tracked tools: the bones, the tool and the calibrator's facets.
inline constexpr const char* tool_marker = "tool";
inline constexpr const char* pointer_marker = "pointer";

}  // namespace helicarm::virtual_devices
