// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <string>
#include <string_view>
#include <thread>

#include "command.h"
#include "helicarm/operation/operation.h"
#include "stop_signal.h"

namespace helicarm::cli {

/// Stops the robot, if any, and every wait for the tracker on a stop signal, at any time.
class Ending {
 public:
  /// `robot` is null if there is none.
  Ending(StopSignal& signal, robot::RobotLink* robot, operation::Operation& operation);

  /// Throws BadInput (interrupted) after a stop signal.
  void check() const;
  /// Polls until the condition holds; throws as `check`.
  template <class Holds>
  void wait_until(const Holds& holds) const {
    for (check(); !holds(); check()) std::this_thread::sleep_for(std::chrono::duration<double>(glance_s));
  }

 private:
  static constexpr double glance_s = 0.05;
  std::atomic<bool> reported_{false};
  std::jthread thread_;
};

/// Asks at the terminal; without a terminal the answer is no. Input typed before a question is discarded.
class Consent {
 public:
  /// `yes`: every order is confirmed without a question.
  Consent(robot::RobotLink& robot, const Ending& ending, bool yes, Console& console)
      : robot_(robot), ending_(ending), yes_(yes), console_(console) {}

  /// The order's token. Throws BadInput once the plan no longer holds (plan_stale) or the record is lost
  /// (record_lost), without waiting for the answer.
  Expected<std::string> operator()(
      const robot::RobotOrder& order,
      const std::function<Expected<void>()>& holds = [] { return Expected<void>(); });

  /// Unlocks the robot at the beginning. Asks before, with the reason, if it is stopped; without consent, and
  /// with `yes`, it throws that reason.
  void unlock();

  /// Asks whether to unlock the robot and plan again. `yes` does not agree: it was given before the stop.
  operation::Operation::Again again() {
    return [this](const Failure& why) { return enters(why, "plan again"); };
  }

 private:
  /// Shows why the robot is stopped and waits for Enter.
  bool enters(const Failure& why, std::string_view what);
  bool agreed(const robot::RobotOrder& order, const std::function<Expected<void>()>& holds);

  robot::RobotLink& robot_;
  const Ending& ending_;
  bool yes_;
  Console& console_;
};

}  // namespace helicarm::cli
