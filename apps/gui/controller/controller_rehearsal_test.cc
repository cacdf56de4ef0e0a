// SPDX-License-Identifier: Apache-2.0
// The threads of controller, devices and interface at work together; also for the thread sanitizer.
#include <QCoreApplication>
#include <QElapsedTimer>
#include <QThread>

#include <gtest/gtest.h>

#include "gui/controller/controller.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::gui {
namespace {

constexpr int rehearsal_patience_ms = 600000;  // for a sanitized program on a busy machine
constexpr int most_attempts = 10;

class ControllerRehearsal : public testing::Test {
 protected:
  ControllerRehearsal() : app_(argc_, argv_), controller_(std::make_unique<Controller>()) {
    controller_->set_virtual_freshness({.pose_s = 10, .state_s = 10, .heartbeat_s = 10});
    virtual_devices::VirtualDevicesOptions equipment;
    equipment.image_size = 512;
    equipment.tracker_port = equipment.rtde_port = equipment.dashboard_port = equipment.script_port = 0;
    controller_->open_virtual_or(equipment, {}, folder_.path());
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
  for (const std::size_t view : {0, 1})
    ASSERT_TRUE(attempt(
        "the view is acquired", [&] { controller_->shoot(controller_->state().views[view]); },
        [&] { return controller_->state().result->views[view].xray_image != nullptr; }));
  ASSERT_TRUE(wait("the views are measured", [&] { return controller_->state().measured; }));
  ASSERT_TRUE(attempt(
      "the robot is registered",
      [&] {
        if (unlock()) controller_->register_robot();
      },
      [&] { return controller_->state().hand_eye_rms_mm.has_value(); }));
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

}  // namespace
}  // namespace helicarm::gui
