// SPDX-License-Identifier: Apache-2.0
#include "consent.h"

#include <functional>
#include <iostream>
#include <sstream>

#include <fcntl.h>
#include <gmock/gmock.h>

#include "helicarm/core/temporary_folder.h"
#include "helicarm/virtual_devices/robot/arm_driver.h"
#include "terminal_test.h"

namespace helicarm::cli {
namespace {

using namespace std::chrono_literals;
using robot::SafetyMode;

/// Standard input of the program for as long as it lives.
class StandardInput {
 public:
  explicit StandardInput(int descriptor) : before_(::dup(STDIN_FILENO)) {
    ::dup2(descriptor, STDIN_FILENO);
    std::cin.clear();
    std::clearerr(stdin);
  }
  ~StandardInput() {
    ::dup2(before_, STDIN_FILENO);
    ::close(before_);
  }
  StandardInput(const StandardInput&) = delete;
  StandardInput& operator=(const StandardInput&) = delete;

 private:
  int before_;
};

/// Text of the program; calls `asked` with each question.
class Prompts : public std::stringbuf {
 public:
  std::function<void()> asked = [] {};

 protected:
  int sync() override {
    asked();
    return 0;
  }
};

/// A robot before its first move.
class ConsentToUnlock : public testing::Test {
 protected:
  ConsentToUnlock() {
    auto driver = std::make_unique<robot::ArmDriver>(robot::ArmOptions{});
    arm_ = driver.get();
    robot::RobotConfig config;
    config.stale_s = config.program_silence_s = config.start_s = 10;  // for a loaded machine
    link_.emplace(config, std::move(driver));
    EXPECT_TRUE(link_->wait_connected(10s));
    operation::OperationPlan plan;
    plan.drill = operation::HandDrill{{0, -140, 20}, {0, -20, 20}};
    operation_ = operation::Operation::begin_freehand(plan, folder_.path() / "session", board_).value();
  }
  void protect() {
    arm_->set_protective_stop(true);
    while (link_->status().phase != robot::LinkPhase::stopped) std::this_thread::yield();
  }
  Expected<void> unlock(bool yes) {
    const Ending ending(signal_, nullptr, *operation_);
    std::ostream progress(&prompts_);
    Console console{progress, progress};
    Consent consent(*link_, ending, yes, console);
    return guarded([&] { consent.unlock(); });
  }
  SafetyMode mode() const { return arm_->state().safety_mode; }

  TemporaryFolder folder_;
  StopSignal signal_;
  tracker::PoseBoard board_;
  robot::ArmDriver* arm_ = nullptr;  ///< lives in the link
  std::optional<robot::RobotLink> link_;
  std::unique_ptr<operation::Operation> operation_;
  Prompts prompts_;
  Terminal terminal_;
};

TEST_F(ConsentToUnlock, LockedRobotIsUnlockedWithoutAQuestion) {
  EXPECT_TRUE(unlock(true));
  EXPECT_EQ(link_->status().phase, robot::LinkPhase::ready);
}

TEST_F(ConsentToUnlock, StopIsNotReleasedByAConsentGivenBeforeIt) {
  const StandardInput input(terminal_.slave);
  protect();
  const auto refused = unlock(true);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::robot_stopped);
  EXPECT_EQ(mode(), SafetyMode::protective_stop);
}

TEST_F(ConsentToUnlock, StopIsNotReleasedWithoutATerminal) {
  const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  const StandardInput input(nothing);
  protect();
  const auto refused = unlock(false);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().reason, Reason::robot_stopped);
  EXPECT_EQ(mode(), SafetyMode::protective_stop);
  ::close(nothing);
}

TEST_F(ConsentToUnlock, StopIsReleasedByEnterAfterItWasShown) {
  const StandardInput input(terminal_.slave);
  protect();
  terminal_.type("\n");  // before the question: no answer
  int questions = 0;
  prompts_.asked = [&] {
    ++questions;
    EXPECT_EQ(mode(), SafetyMode::protective_stop);
    terminal_.type("\n");
  };
  EXPECT_TRUE(unlock(false));
  EXPECT_EQ(questions, 1);
  EXPECT_THAT(prompts_.str(), testing::HasSubstr("PROTECTIVE_STOP"));
  EXPECT_EQ(mode(), SafetyMode::normal);
  EXPECT_EQ(link_->status().phase, robot::LinkPhase::ready);
}

}  // namespace
}  // namespace helicarm::cli
