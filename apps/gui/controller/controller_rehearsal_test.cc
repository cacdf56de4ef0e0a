// SPDX-License-Identifier: Apache-2.0
// The threads of controller, devices and interface at work together; also for the thread sanitizer.
#include <QCoreApplication>
#include <QElapsedTimer>
#include <QThread>

#include <gtest/gtest.h>

#include "gui/controller/controller.h"
#include "helicarm/case_registration/register_case.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::gui {
namespace {

constexpr int rehearsal_patience_ms = 600000;  // for a sanitized program on a busy machine
constexpr int most_attempts = 10;

class ControllerRehearsal : public testing::Test {
 protected:
  explicit ControllerRehearsal(bool by_ct = false, bool by_hand = false)
      : app_(argc_, argv_), controller_(std::make_unique<Controller>()) {
    controller_->set_virtual_freshness({.pose_s = 10, .state_s = 10, .heartbeat_s = 10});
    virtual_devices::VirtualDevicesOptions equipment;
    equipment.image_size = 512;
    equipment.freehand = by_hand;
    equipment.tracker_port = equipment.rtde_port = equipment.dashboard_port = equipment.script_port = 0;
    controller_->open_virtual_or(equipment, {}, folder_.path() / "session", by_ct);
  }

  /// Meanwhile reads all live data, as the window does.
  template <class Done>
  bool wait(const char* what, const Done& done) {
    QElapsedTimer since;
    since.start();
    while (!done() && since.elapsed() < rehearsal_patience_ms) {
      QCoreApplication::processEvents();
      static_cast<void>(controller_->live());
      QThread::msleep(10);
    }
    if (done()) return true;
    const ApplicationState& state = controller_->state();
    std::string why = state.busy ? "busy with " + state.doing : "idle";
    for (const auto& [phase, failure] : state.refusals) why += "; " + failure.message;
    ADD_FAILURE() << "timeout waiting until " << what << "; observed: " << why;
    return false;
  }
  bool idle() {
    return wait("the controller is idle", [&] { return !controller_->state().busy; });
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
        "the robot is unlocked", [&] { controller_->unlock("tester"); },
        [&] { return controller_->live().robot.phase == robot::LinkPhase::ready; });
  }
  bool acquire() {
    for (const std::size_t view : {0, 1})
      if (!attempt(
              "the view is acquired", [&] { controller_->shoot(controller_->state().views[view]); },
              [&] { return controller_->state().result->views[view].xray_image != nullptr; }))
        return false;
    return wait("the views are measured",
                [&] { return controller_->state().measured && !controller_->state().busy; });
  }
  bool register_robot() {
    return attempt(
        "the robot is registered",
        [&] {
          if (unlock()) controller_->register_robot();
        },
        [&] { return controller_->state().hand_eye_rms_mm.has_value(); });
  }
  bool moves() const { return controller_->live().robot.phase == robot::LinkPhase::moving; }

  int argc_ = 1;
  char name_[5] = "ctrl";
  char* argv_[2] = {name_, nullptr};
  QCoreApplication app_;
  TemporaryFolder folder_;
  std::unique_ptr<Controller> controller_;
};

TEST_F(ControllerRehearsal, MeasuresAndFollowsTheToolWhileTheDevicesWork) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(acquire());
  ASSERT_TRUE(register_robot());
  controller_->take_offered_picks();
  ASSERT_TRUE(wait("the picks are located", [&] {
    return !controller_->state().busy && controller_->state().result->points.size() > 3;
  }));
  controller_->follow(controller_->state().tunnels.front().name);
  controller_->move_bone("tibia", {1, 0, 0});
  EXPECT_TRUE(wait("the tool is followed", [&] {
    const LiveState live = controller_->live();
    return live.tool && *live.tool && live.aim && *live.aim;
  }));
}

TEST_F(ControllerRehearsal, StopAndFaultsReachTheRobotFromOtherThreads) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(unlock());
  controller_->register_robot();
  ASSERT_TRUE(wait("the robot moves", [&] { return moves(); }));
  controller_->set_fault("hide:pointer", true);
  controller_->stop();
  ASSERT_TRUE(idle());
  EXPECT_EQ(controller_->live().robot.phase, robot::LinkPhase::stopped);
  EXPECT_FALSE(controller_->state().hand_eye_rms_mm);
}

TEST_F(ControllerRehearsal, EndsWhileTheRobotMoves) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(unlock());
  controller_->register_robot();
  ASSERT_TRUE(wait("the robot moves", [&] { return moves(); }));
  controller_.reset();
}

class ControllerCtRehearsal : public ControllerRehearsal {
 protected:
  ControllerCtRehearsal() : ControllerRehearsal(true) {}

  const ApplicationState& state() const { return controller_->state(); }
  const operation::OperationTunnel& tunnel() const { return state().tunnels.front(); }
  bool register_models() {
    controller_->register_models();
    return idle();
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

TEST_F(ControllerCtRehearsal, AConfirmedRegistrationGuidesTheToolToTheTunnelsOfTheCt) {
  ASSERT_TRUE(idle());
  EXPECT_TRUE(state().has_models);
  EXPECT_TRUE(ends_to_pick(tunnel()).empty());
  ASSERT_TRUE(acquire());
  EXPECT_FALSE(next_pick(state()));
  ASSERT_TRUE(register_models());
  ASSERT_TRUE(state().registration);
  ASSERT_FALSE(state().registration->refused());
  EXPECT_TRUE(awaits_confirmation(state()));
  ASSERT_TRUE(register_robot());
  EXPECT_EQ(refusal_of_plan(), Reason::registration_not_confirmed);
  controller_->confirm_registration();
  ASSERT_TRUE(idle());
  EXPECT_TRUE(state().is_confirmed);
  EXPECT_TRUE(may_guide(state(), tunnel()));
  ASSERT_TRUE(plans());
  controller_->follow(tunnel().name);
  EXPECT_TRUE(wait("the tool is followed", [&] {
    const LiveState live = controller_->live();
    return live.aim && *live.aim;
  }));

  registration::RigidStep step = registration::RigidStep::Zero();
  step[3] = 2;
  controller_->nudge(0, step);
  EXPECT_FALSE(state().order);
  EXPECT_FALSE(may_guide(state(), tunnel()));
  ASSERT_TRUE(register_models());
  EXPECT_TRUE(awaits_confirmation(state()));
  EXPECT_EQ(refusal_of_plan(), Reason::registration_not_confirmed);
  controller_->nudge(1, step);
  ASSERT_TRUE(register_models());
  ASSERT_EQ(state().starts_by_hand.size(), 2U);  // each keeps its own
  EXPECT_EQ(state().starts_by_hand[0].model, state().models[0]);
  controller_->undo();  // to no earlier registration
  EXPECT_TRUE(state().registration);
  EXPECT_FALSE(state().nudged);
}

TEST_F(ControllerCtRehearsal, AnotherImageEndsTheRegistrationACancelledOneDoesNot) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(acquire());
  ASSERT_TRUE(register_models());
  controller_->confirm_registration();
  ASSERT_TRUE(idle());
  ASSERT_TRUE(state().is_confirmed);
  controller_->register_models();
  controller_->cancel();
  ASSERT_TRUE(idle());
  EXPECT_EQ(state().refusals.at(Phase::registration).reason, Reason::interrupted);
  EXPECT_TRUE(state().registration);
  EXPECT_TRUE(state().is_confirmed);
  EXPECT_NE(controller_->live().robot.phase, robot::LinkPhase::stopped);
  const int measurements = state().measurements;
  ASSERT_TRUE(attempt(
      "the view is acquired again", [&] { controller_->shoot("AP"); },
      [&] { return !state().is_confirmed; }));
  ASSERT_TRUE(wait("the views are measured again", [&] { return state().measurements > measurements; }));
  EXPECT_FALSE(state().registration);
}

class ControllerDrill : public ControllerRehearsal {
 protected:
  ControllerDrill() : ControllerRehearsal(true, true) {}

  const ApplicationState& state() const { return controller_->state(); }
  bool is_guided() const {
    const LiveState live = controller_->live();
    return live.drill && live.drill->aim;
  }
  bool is_at_the_end() const {
    const LiveState live = controller_->live();
    return live.drill && live.drill->aim && live.drill->aim->depth_mm >= live.drill->aim->length_mm;
  }
};

TEST_F(ControllerDrill, ADrillInTheHandIsGuidedToATunnelOfTheCtAndVerified) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(state().drill);
  ASSERT_TRUE(acquire());
  controller_->guide_drill("femur");
  ASSERT_TRUE(idle());
  EXPECT_EQ(state().refusals.at(Phase::navigate).reason, Reason::registration_not_confirmed);
  controller_->register_models();
  ASSERT_TRUE(idle());
  controller_->confirm_registration();
  ASSERT_TRUE(idle());
  ASSERT_TRUE(state().is_confirmed);

  controller_->guide_drill("femur");
  ASSERT_TRUE(wait("the drill is guided", [&] { return is_guided(); }));
  controller_->verify_drilled();  // far from the tunnel's end
  ASSERT_TRUE(
      wait("the verification is refused", [&] { return state().refusals.contains(Phase::navigate); }));
  EXPECT_EQ(state().refusals.at(Phase::navigate).reason, Reason::off_target);
  ASSERT_TRUE(wait("the drill is guided on", [&] { return is_guided(); }));
  controller_->end_guidance();
  ASSERT_TRUE(idle());
  EXPECT_FALSE(controller_->live().drill);
  EXPECT_TRUE(state().outcomes.empty());

  for (int left = most_attempts; left > 0 && state().outcomes.empty(); --left) {
    controller_->guide_drill("femur");
    ASSERT_TRUE(wait("the drill is at the tunnel's end", [&] { return is_at_the_end() || !state().busy; }));
    controller_->verify_drilled();
    ASSERT_TRUE(wait("the tunnel is verified or refused",
                     [&] { return !state().busy || state().refusals.contains(Phase::navigate); }));
    controller_->end_guidance();
    ASSERT_TRUE(idle());
  }
  ASSERT_TRUE(state().outcomes.contains("femur"));
  EXPECT_LT(state().outcomes.at("femur").end.distance_mm(), 3);
}

}  // namespace
}  // namespace helicarm::gui
