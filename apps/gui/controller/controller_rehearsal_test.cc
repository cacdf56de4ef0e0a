// SPDX-License-Identifier: Apache-2.0
// The threads of controller, devices and interface at work together; also for the thread sanitizer.
#include <gtest/gtest.h>

#include "gui/controller/rehearsal_fixtures_test.h"
#include "helicarm/case_registration/register_case.h"

namespace helicarm::gui {
namespace {

TEST_F(ControllerRehearsal, MeasuresAndFollowsTheToolWhileTheDevicesWork) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(acquire());
  ASSERT_TRUE(register_robot());
  controller_->take_offered_picks();
  ASSERT_TRUE(
      wait("the picks are located", [&] { return !state().busy && state().result->points.size() > 3; }));
  controller_->follow(state().tunnels.front().name);
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
  EXPECT_FALSE(state().hand_eye_rms_mm);
}

TEST_F(ControllerRehearsal, ProtectiveStopThatWasNotShownIsNotReleased) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(unlock());
  const robot::RobotLinkStatus shown = controller_->live().robot;
  controller_->set_fault("protective_stop", true);
  ASSERT_TRUE(
      wait("the robot stops", [&] { return controller_->live().robot.phase == robot::LinkPhase::stopped; }));
  controller_->unlock("tester", shown);
  ASSERT_TRUE(idle());
  const Failure& refused = state().refusals.at(Phase::navigate);
  EXPECT_EQ(refused.reason, Reason::robot_stopped);
  EXPECT_NE(refused.message.find("PROTECTIVE_STOP"), std::string::npos) << refused.message;
  EXPECT_EQ(controller_->live().robot.state->safety_mode, robot::SafetyMode::protective_stop);
}

TEST_F(ControllerRehearsal, EndsWhileTheRobotMoves) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(unlock());
  controller_->register_robot();
  ASSERT_TRUE(wait("the robot moves", [&] { return moves(); }));
  controller_.reset();
}

TEST_F(ControllerCtRehearsal, AConfirmedRegistrationGuidesTheToolToTheTunnelsOfTheCt) {
  ASSERT_TRUE(idle());
  EXPECT_TRUE(state().has_models);
  EXPECT_TRUE(ends_to_pick(tunnel()).empty());
  ASSERT_TRUE(acquire());
  EXPECT_FALSE(next_pick(state()));
  ASSERT_TRUE(register_models());
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
  EXPECT_EQ(state().starts_by_hand[0].model, state().models[0].name);
  controller_->undo();  // to no earlier registration
  EXPECT_TRUE(state().registration);
  EXPECT_FALSE(state().nudged);
}

TEST_F(ControllerCtRehearsal, AnotherImageEndsTheRegistrationACancelledOneDoesNot) {
  ASSERT_TRUE(register_and_confirm());
  controller_->register_models();
  controller_->cancel();
  const auto said = QObject::connect(controller_.get(), &Controller::changed, [this] {
    if (state().busy) EXPECT_TRUE(state().doing.starts_with("cancelling")) << state().doing;
  });
  ASSERT_TRUE(idle());
  QObject::disconnect(said);
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

TEST_F(ControllerCtRehearsal, WhatTheOperationForgetsWhereItsRecordFailsIsNotShownAnyMore) {
  ASSERT_TRUE(register_and_confirm());
  std::filesystem::remove(state().folder / "session.log");
  controller_->measure();
  ASSERT_TRUE(idle());
  EXPECT_EQ(state().refusals.at(Phase::calibrate).reason, Reason::record_lost);
  EXPECT_FALSE(state().measured);
  EXPECT_FALSE(state().registration);
  EXPECT_FALSE(state().is_confirmed);
  for (const pipeline::ViewResult& view : state().result->views) {
    EXPECT_TRUE(view.xray_image) << view.name;
    EXPECT_FALSE(view.calibrated) << view.name;
  }
}

TEST_F(ControllerCtRehearsal, WorkThatFailsWithoutAChangeOfTheOperationKeepsWhatIsShown) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(acquire());
  ASSERT_TRUE(register_models());
  const auto result = state().result;
  const auto registration = state().registration;
  EXPECT_EQ(refusal_of_plan(), Reason::registration_not_confirmed);
  EXPECT_TRUE(state().measured);
  EXPECT_EQ(state().result, result);
  EXPECT_EQ(state().registration, registration);
}

TEST_F(ControllerCtRehearsal, ARegistrationAgainEndsTheMovesFromTheOneBefore) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(acquire());
  ASSERT_TRUE(register_models());
  registration::RigidStep step = registration::RigidStep::Zero();
  step[3] = 2;
  controller_->nudge(0, step);
  controller_->undo();
  ASSERT_TRUE(controller_->can_redo());
  ASSERT_TRUE(register_models());
  EXPECT_FALSE(controller_->can_redo());
  EXPECT_TRUE(controller_->redoes().isEmpty());
}

class ControllerDrill : public ControllerRehearsal {
 protected:
  ControllerDrill() : ControllerRehearsal(true, true) {}

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
  ASSERT_TRUE(register_models());
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
  EXPECT_TRUE(wait("the bar shows the pose that the decision is of", [&] {
    const LiveState live = controller_->live();
    return live.drill && live.drill->aim && live.aim && *live.aim &&
           (*live.aim)->distance_mm == live.drill->aim->distance_mm;
  }));
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
  EXPECT_TRUE(state().outcomes.at("femur").depth());
}

}  // namespace
}  // namespace helicarm::gui
