// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "gui/controller/controller_fixtures_test.h"

namespace helicarm::gui {

inline constexpr int most_attempts = 10;

/// An operation with virtual devices.
class ControllerRehearsal : public ControllerFixture<QCoreApplication> {
 protected:
  explicit ControllerRehearsal(bool by_ct = false, bool by_hand = false) {
    controller_->set_virtual_freshness({.pose_s = 10, .state_s = 10, .heartbeat_s = 10});
    virtual_devices::VirtualDevicesOptions equipment;
    equipment.image_size = 512;
    equipment.freehand = by_hand;
    equipment.tracker_port = equipment.rtde_port = equipment.dashboard_port = equipment.script_port = 0;
    controller_->open_virtual_or(equipment, {}, folder_.path() / "session", by_ct);
  }

  template <class Act, class Done>
  bool attempt(const char* what, const Act& act, const Done& done) {
    for (int left = most_attempts; left > 0 && !done(); --left) {
      act();
      if (!idle()) return false;
    }
    return wait(what, done);
  }
  bool unlock() {
    return attempt(
        "the robot is unlocked", [&] { controller_->unlock("tester", controller_->live().robot); },
        [&] { return controller_->live().robot.phase == robot::LinkPhase::ready; });
  }
  bool acquire() {
    for (const std::size_t view : {0, 1})
      if (!attempt(
              "the view is acquired", [&] { controller_->shoot(state().views[view]); },
              [&] { return state().result->views[view].xray_image != nullptr; }))
        return false;
    return wait("the views are measured", [&] { return state().measured && !state().busy; });
  }
  bool register_robot() {
    return attempt(
        "the robot is registered",
        [&] {
          if (unlock()) controller_->register_robot();
        },
        [&] { return state().hand_eye_rms_mm.has_value(); });
  }
  bool moves() const { return controller_->live().robot.phase == robot::LinkPhase::moving; }
};

/// Its tunnels are lines in a CT.
class ControllerCtRehearsal : public ControllerRehearsal {
 protected:
  ControllerCtRehearsal() : ControllerRehearsal(true) {}

  const operation::OperationTunnel& tunnel() const { return state().tunnels.front(); }
  bool register_and_confirm() {
    if (!idle() || !acquire() || !register_models()) return false;
    controller_->confirm_registration();
    return idle() && state().is_confirmed;
  }
  /// Until no pose or state of the robot came late.
  Reason refusal_of_plan() {
    for (int left = most_attempts; left > 0; --left) {
      controller_->plan_order(tunnel().name);
      if (!idle() || state().order) break;
      const auto refusal = state().refusals.find(Phase::navigate);
      if (refusal == state().refusals.end()) break;
      if (!operation::is_of_a_reading(refusal->second)) return refusal->second.reason;
    }
    return Reason::interrupted;
  }
  bool plans() {
    return attempt(
        "the path is planned", [&] { controller_->plan_order(tunnel().name); },
        [&] { return state().order.has_value(); });
  }
};

}  // namespace helicarm::gui
