// SPDX-License-Identifier: Apache-2.0
#include <thread>

#include <gmock/gmock.h>

#include "helicarm/case_registration/dicom_measurements.h"
#include "helicarm/core/files.h"
#include "helicarm/operation/replay.h"
#include "helicarm/rehearsal/ct_plan.h"
#include "helicarm/rehearsal/stale_plan_fixture_test.h"

namespace helicarm::rehearsal {
namespace {

TEST_F(StalePlan, StaleOrderDoesNotMoveTheRobotThoughConfirmed) {
  // The leg moves while the confirmation is open; the plan stays stale even if the leg returns.
  robot::RobotOrder order = plan();
  move_femur(40);
  const Failure moved = wait_until_stale(order);
  EXPECT_NEAR(moved.figures.at("distance_mm"), 40, 1);
  EXPECT_THAT(moved.message, testing::HasSubstr("femur moved"));
  expect_nothing_moves(order);
  move_femur(-40);
  std::this_thread::sleep_for(1s);
  expect_nothing_moves(order);
  // Another plan to the same tunnel replaces it.
  const robot::RobotOrder former = plan();
  order = plan();
  if (robot::to_json(former) != robot::to_json(order)) expect_nothing_moves(former);
  // The tracker takes the calibrator for the femur.
  ASSERT_TRUE(virtual_or_->set_fault("swapped_calibrator", true));
  EXPECT_GT(wait_until_stale(order).figures.at("distance_mm"), 10);
  ASSERT_TRUE(virtual_or_->set_fault("swapped_calibrator", false));
  expect_nothing_moves(order);
  // The robot's table is pushed: detected since planning; a new plan also needs a new registration.
  std::this_thread::sleep_for(1s);
  order = plan();
  virtual_or_->simulated_scene().move_base({3, 0, 0});
  EXPECT_THAT(wait_until_stale(order).message, testing::HasSubstr("robot base or tool moved"));
  expect_nothing_moves(order);
  std::this_thread::sleep_for(1s);
  Expected<robot::RobotOrder> again = operation_->plan_order("femur");
  for (int i = 0; i < most_attempts && !again && is_timing_failure(again.error()); ++i)
    again = operation_->plan_order("femur");
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().reason, Reason::plan_stale) << again.error().message;
  EXPECT_THAT(again.error().message, testing::HasSubstr("since registration"));
  operation_.reset();
  const auto replayed = operation::replay(folder_.path() / "session");
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_THAT(replayed->differences, testing::IsEmpty());
}

TEST_F(StalePlan, NothingMovesWithoutTheRecord) {
  const std::filesystem::path session = folder_.path() / "session", log = session / "session.log",
                              aside = folder_.path() / "aside";
  const robot::RobotOrder order = plan();
  const auto expect_no_motion = [&](const char* attack) {
    SCOPED_TRACE(attack);
    unlock();
    const robot::Joints before = virtual_or_->robot().truth().state.joints;
    EXPECT_EQ(operation_->check_plan(order).error().reason, Reason::record_lost);
    for (const auto& done : {operation_->go(order, robot().confirm(order)).map([](const auto&) {}),
                             operation_->withdraw(order, robot().wait_connected(5s).value(), nod_),
                             operation_->register_robot(nod_)}) {
      ASSERT_FALSE(done);
      EXPECT_EQ(done.error().reason, Reason::record_lost) << done.error().message;
    }
    EXPECT_EQ(virtual_or_->robot().truth().state.joints, before);
  };
  std::filesystem::rename(log, aside);
  expect_no_motion("the log is removed");
  std::filesystem::copy_file(aside, log);
  expect_no_motion("the log is replaced by its copy");
  std::filesystem::rename(aside, log);
  std::filesystem::rename(session, aside);
  expect_no_motion("the folder is removed");
  std::filesystem::rename(aside, session);
  // While a confirmation of the registration is open.
  const robot::Joints before = virtual_or_->robot().truth().state.joints;
  try_to([&] {
    const auto registered = operation_->register_robot([&](const robot::RobotOrder& move) {
      std::filesystem::rename(log, aside);
      return nod_(move);
    });
    if (!registered && registered.error().reason == Reason::record_lost) return Expected<void>();
    return registered;
  });
  EXPECT_EQ(virtual_or_->robot().truth().state.joints, before);
}

TEST_F(StalePlan, RobotStopsWhenTheRecordIsRemovedDuringItsMotion) {
  bool stopped = false;
  for (int attempt = 0; attempt < most_attempts && !stopped; ++attempt) {
    const robot::RobotOrder order = plan();
    const std::filesystem::path log = folder_.path() / "session" / "session.log",
                                aside = folder_.path() / "aside";
    std::jthread attacker([&] {
      for (int i = 0; i < 2000 && !virtual_or_->robot().truth().moving; ++i) std::this_thread::sleep_for(5ms);
      std::filesystem::rename(log, aside);
    });
    const auto gone = operation_->go(order, robot().confirm(order));
    attacker.join();
    std::filesystem::rename(aside, log);
    ASSERT_FALSE(gone);
    stopped = gone.error().reason == Reason::record_lost;
    if (!stopped) {
      ASSERT_TRUE(is_timing_failure(gone.error()) || gone.error().reason == Reason::plan_stale)
          << gone.error().message;
    }
    std::this_thread::sleep_for(500ms);
    EXPECT_FALSE(virtual_or_->robot().truth().moving);
    ASSERT_TRUE(robot().unlock("tester", robot().status()));
  }
  EXPECT_TRUE(stopped);
}

TEST_F(StalePlan, TwoTunnelsAreCarriedOutOnOneCalibration) {
  for (const operation::OperationTunnel& tunnel : plan_.tunnels) {
    bool done = false;
    for (int attempt = 0; attempt < most_attempts && !done; ++attempt) {
      const robot::RobotState rest = robot().wait_connected(5s).value();
      const robot::RobotOrder order = plan(tunnel.name);
      const auto gone = operation_->go(order, robot().confirm(order));
      done = gone.has_value();
      if (!done) {
        ASSERT_TRUE(is_timing_failure(gone.error())) << gone.error().message;
      }
      try_to([&] { return operation_->withdraw(order, rest, nod_); });
    }
    EXPECT_TRUE(done) << tunnel.name;
  }
  EXPECT_EQ(operation_->calibrations(), 1);
  // What is reported of it.
  const auto measured = operation_->measurement();
  ASSERT_TRUE(measured) << measured.error().message;
  EXPECT_EQ(measured->result.verifications.size(), plan_.tunnels.size());
  const auto written = case_registration::write_dicom_results(*operation_->measured_case(), *measured,
                                                              folder_.path(), folder_.path());
  ASSERT_TRUE(written) << written.error().message;
  const std::string report = read_file(written->files.at(0), 1 << 22).value();
  for (const char* words : {"tool_line", "off_end", "femur"}) EXPECT_THAT(report, testing::HasSubstr(words));
}

TEST_F(StalePlan, OrderToABoneAtRestIsCarriedOutWithinTheLimits) {
  double most_mm = 0, most_deg = 0;
  bool done = false;
  for (int attempt = 0; attempt < most_attempts && !done; ++attempt) {
    const robot::RobotState rest = robot().wait_connected(5s).value();
    const robot::RobotOrder order = plan();
    const operation::PlanWatch watch = operation_->plan_watch(order).value();
    std::jthread look([&](const std::stop_token& over) {
      for (; !over.stop_requested(); std::this_thread::sleep_for(15ms))
        if (const auto moved =
                watch.base_motion(devices_->board(), robot().track(), tracker::monotonic_seconds())) {
          most_mm = std::max(most_mm, moved->distance_mm);
          most_deg = std::max(most_deg, moved->turn_deg);
        }
    });
    const auto gone = operation_->go(order, robot().confirm(order));
    look.request_stop();
    look.join();
    done = gone.has_value();
    if (!done) {
      ASSERT_TRUE(is_timing_failure(gone.error())) << gone.error().message;
    }
    try_to([&] { return operation_->withdraw(order, rest, nod_); });
  }
  EXPECT_TRUE(done) << "the machine is too busy for this test";
  RecordProperty("most_um", int(most_mm * 1000));
  RecordProperty("most_mdeg", int(most_deg * 1000));
}

TEST_F(StalePlan, CreepingBoneStopsTheToolWhichIsThenWithdrawn) {
  for (int attempt = 0; attempt < most_attempts; ++attempt) {
    const robot::RobotState rest = robot().wait_connected(5s).value();
    const robot::RobotOrder order = plan();
    const std::string token = robot().confirm(order);
    std::jthread creep([&](const std::stop_token& over) {
      while (!virtual_or_->robot().truth().moving && !over.stop_requested()) std::this_thread::sleep_for(5ms);
      for (int i = 0; i < 15 && !over.stop_requested(); ++i) {
        move_femur(2);
        std::this_thread::sleep_for(170ms);
      }
    });
    const auto gone = operation_->go(order, token);
    creep.request_stop();
    creep.join();
    ASSERT_FALSE(gone);
    EXPECT_EQ(robot().status().phase, robot::LinkPhase::stopped);
    EXPECT_FALSE(virtual_or_->robot().truth().moving);
    const Failure& refused = gone.error();
    try_to([&] { return operation_->withdraw(order, rest, nod_); });
    const robot::RobotState back = robot().wait_connected(5s).value();
    EXPECT_LT((back.base_from_tcp.translation - rest.base_from_tcp.translation).norm(), 0.5);
    if (is_timing_failure(refused)) continue;  // unrelated to the bone
    EXPECT_EQ(refused.reason, Reason::plan_stale) << refused.message;
    return;
  }
  FAIL() << "the machine is too busy for this test";
}

/// The tunnels are of a CT's plan.
class StaleRegistration : public StalePlan {
 protected:
  operation::OperationPlan planned(operation::OperationPlan plan) const override {
    return with_ct_plan(std::move(plan), virtual_or_->simulated_scene().simulated_case(), folder_.path());
  }
};

TEST_F(StaleRegistration, TheToolLeavesTheBoneAndDoesNotReturnToIt) {
  const auto registered = operation_->register_models();
  ASSERT_TRUE(registered) << registered.error().message;
  ASSERT_TRUE(operation_->confirm_registration());
  const robot::RobotState rest = robot().wait_connected(5s).value();
  std::optional<robot::RobotOrder> order;
  try_to([&]() -> Expected<void> {
    order = plan();
    return operation_->go(*order, robot().confirm(*order)).map([](const auto&) {});
  });
  const auto distance_mm = [&] {
    const auto state = robot().wait_connected(20s);
    return (state.value().base_from_tcp.translation - rest.base_from_tcp.translation).norm();
  };
  EXPECT_GT(distance_mm(), 20);
  // With the tool in the bone an image is taken again: the registration is of other images now.
  expose("AP");
  unlock();
  EXPECT_EQ(operation_->go(*order, robot().confirm(*order)).error().reason, Reason::registration_stale);
  EXPECT_EQ(operation_->plan_order("femur").error().reason, Reason::usage);  // nothing is measured
  EXPECT_EQ(operation_->preview(*order).error().reason, Reason::usage);
  try_to([&] { return operation_->withdraw(*order, rest, nod_); });
  EXPECT_LT(distance_mm(), 0.5);
  // Out of the bone, and measured again without the models.
  ASSERT_TRUE(operation_->measure());
  EXPECT_EQ(operation_->plan_order("femur").error().reason, Reason::registration_stale);
  unlock();
  EXPECT_EQ(operation_->go(*order, robot().confirm(*order)).error().reason, Reason::registration_stale);
  EXPECT_LT(distance_mm(), 0.5);
  ASSERT_TRUE(operation_->finish());
  operation_.reset();
  const auto replayed = operation::replay(folder_.path() / "session");
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_THAT(replayed->differences, testing::IsEmpty());
}

/// Picked tunnels within a limit that their points keep in the images, but not at the tool's tip.
class UncertainPicks : public StalePlan {
 protected:
  operation::OperationPlan planned(operation::OperationPlan plan) const override {
    plan.max_error_mm = 0.62;
    return plan;
  }
};

TEST_F(UncertainPicks, GuideNoRobot) {
  Expected<robot::RobotOrder> order = fail(Reason::stale_pose, "not tried");
  for (int i = 0; i < most_attempts && !order && operation::is_of_a_reading(order.error()); ++i)
    order = operation_->plan_order("femur");
  ASSERT_FALSE(order);
  EXPECT_EQ(order.error().reason, Reason::uncertain) << order.error().message;
  EXPECT_GT(order.error().figures.at("error_95_mm"), plan_.max_error_mm);
}

class StalePlanToACheckedBone : public StalePlan {
 protected:
  std::vector<operation::PlannedCheck> check_points() const override {
    return {{"femur notch", "femur", 1.5}};
  }
};

TEST_F(StalePlanToACheckedBone, IsMadeAgainOnlyAfterTouchingTheCheckPointAgain) {
  ASSERT_TRUE(touch());
  const robot::RobotOrder order = plan();
  EXPECT_TRUE(operation_->checks_to_come("femur").empty());
  virtual_or_->simulated_scene().bump_marker("femur", {3, 0, 0});
  EXPECT_EQ(wait_until_stale(order).reason, Reason::plan_stale);
  EXPECT_EQ(operation_->checks_to_come("femur"), std::vector<std::string>{"femur notch"});
  EXPECT_EQ(operation_->plan_order("femur").error().reason, Reason::usage);
  EXPECT_EQ(touch().error().reason, Reason::residual_too_large);
}

TEST_F(StalePlanToACheckedBone, EndsWithACheckPointThatIsRefused) {
  ASSERT_TRUE(touch());
  virtual_or_->simulated_scene().bump_marker("femur", {3, 0, 0});
  const robot::RobotOrder order = plan();  // to the displaced marker, which then rests
  const Failure refused = touch().error();
  EXPECT_EQ(refused.reason, Reason::residual_too_large) << refused.message;
  EXPECT_EQ(operation_->check_plan(order).error().reason, Reason::residual_too_large);
  unlock();
  const robot::Joints before = virtual_or_->robot().truth().state.joints;
  EXPECT_EQ(operation_->go(order, robot().confirm(order)).error().reason, Reason::residual_too_large);
  EXPECT_EQ(virtual_or_->robot().truth().state.joints, before);
  // A luckier touch does not begin a new operation.
  virtual_or_->simulated_scene().bump_marker("femur", {-3, 0, 0});
  EXPECT_EQ(touch().error().message, refused.message);
  EXPECT_EQ(operation_->plan_order("femur").error().reason, Reason::residual_too_large);
  ASSERT_TRUE(operation_->finish());
  operation_.reset();
  const auto replayed = operation::replay(folder_.path() / "session");
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_THAT(replayed->differences, testing::IsEmpty());
}

TEST_F(StalePlanToACheckedBone, IsTouchedAfterTheLastImage) {
  ASSERT_TRUE(touch());
  EXPECT_TRUE(operation_->checks_to_come("femur").empty());
  expose("AP");
  EXPECT_EQ(operation_->checks_to_come("femur"), std::vector<std::string>{"femur notch"});
}

}  // namespace
}  // namespace helicarm::rehearsal
