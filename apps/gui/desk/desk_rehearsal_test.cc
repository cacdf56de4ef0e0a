// SPDX-License-Identifier: Apache-2.0
// The desk's threads, its devices' and the interface's at work at once; also for the thread sanitizer.
#include <QCoreApplication>
#include <QElapsedTimer>
#include <QThread>

#include <gtest/gtest.h>

#include "gui/desk/desk.h"
#include "helicarm/core/temporary_folder.h"

namespace helicarm::gui {
namespace {

constexpr int patience_ms = 600000;  // a sanitized program on a busy machine
constexpr int most_attempts = 10;

class DeskRehearsal : public testing::Test {
 protected:
  DeskRehearsal() : app_(argc_, argv_), desk_(std::make_unique<Desk>()) {
    desk_->set_virtual_freshness({.pose_s = 10, .state_s = 10, .heartbeat_s = 10});
    operating_room::VirtualRoomOptions room;
    room.picture_size = 512;
    room.tracker_port = room.rtde_port = room.dashboard_port = room.script_port = 0;
    desk_->open_room(room, {}, folder_.path());
  }

  /// Meanwhile it looks at everything that is live, as the window does.
  template <class Done>
  bool wait(const char* what, const Done& done) {
    QElapsedTimer since;
    since.start();
    while (!done() && since.elapsed() < patience_ms) {
      QCoreApplication::processEvents();
      static_cast<void>(desk_->live());
      QThread::msleep(10);
    }
    if (done()) return true;
    const DeskState& state = desk_->state();
    std::string why = state.busy ? "busy with " + state.doing : "idle";
    for (const auto& [phase, failure] : state.refusals) why += "; " + failure.message;
    ADD_FAILURE() << "waited in vain until " << what << "; seen: " << why;
    return false;
  }
  bool idle() {
    return wait("nothing is being done", [&] { return !desk_->state().busy; });
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
        "the robot is unlocked", [&] { desk_->unlock("tester"); },
        [&] { return desk_->live().robot.phase == LinkPhase::ready; });
  }
  bool moves() const { return desk_->live().robot.phase == LinkPhase::moving; }

  int argc_ = 1;
  char name_[5] = "desk";
  char* argv_[2] = {name_, nullptr};
  QCoreApplication app_;
  TemporaryFolder folder_;
  std::unique_ptr<Desk> desk_;
};

TEST_F(DeskRehearsal, MeasuresAndFollowsTheToolWhileTheDevicesWork) {
  ASSERT_TRUE(idle());
  for (const std::size_t view : {0, 1})
    ASSERT_TRUE(attempt(
        "the view is taken", [&] { desk_->shoot(desk_->state().views[view]); },
        [&] { return desk_->state().result->views[view].exposure != nullptr; }));
  ASSERT_TRUE(wait("the views are measured", [&] { return desk_->state().measured; }));
  ASSERT_TRUE(attempt(
      "the robot is registered",
      [&] {
        if (unlock()) desk_->register_robot();
      },
      [&] { return desk_->state().hand_eye_rms_mm.has_value(); }));
  desk_->take_offered_picks();
  ASSERT_TRUE(wait("the picks are located",
                   [&] { return !desk_->state().busy && desk_->state().result->points.size() > 3; }));
  desk_->follow(desk_->state().tunnels.front().name);
  desk_->move_bone("tibia", {1, 0, 0});
  EXPECT_TRUE(wait("the tool is followed", [&] {
    const LiveState live = desk_->live();
    return live.tool && *live.tool && live.aim && *live.aim;
  }));
}

TEST_F(DeskRehearsal, StopAndFaultsReachTheRobotFromOtherThreads) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(unlock());
  desk_->register_robot();
  ASSERT_TRUE(wait("the robot moves", [&] { return moves(); }));
  desk_->set_fault("hide:pointer", true);
  desk_->stop();
  ASSERT_TRUE(idle());
  EXPECT_EQ(desk_->live().robot.phase, LinkPhase::stopped);
  EXPECT_FALSE(desk_->state().hand_eye_rms_mm);
}

TEST_F(DeskRehearsal, EndsWhileTheRobotMoves) {
  ASSERT_TRUE(idle());
  ASSERT_TRUE(unlock());
  desk_->register_robot();
  ASSERT_TRUE(wait("the robot moves", [&] { return moves(); }));
  desk_.reset();
}

}  // namespace
}  // namespace helicarm::gui
