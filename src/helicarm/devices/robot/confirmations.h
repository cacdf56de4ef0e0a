// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <map>
#include <string>

#include "helicarm/devices/robot/robot_order.h"

namespace helicarm::robot {

/// Tokens that confirm one order, once, for a limited time. A token is bound to every digit of its order.
class Confirmations {
 public:
  using Clock = std::chrono::steady_clock;

  explicit Confirmations(Clock::duration valid_for = std::chrono::minutes(2)) : valid_for_(valid_for) {}

  /// Call after a user has seen the order and agreed. Returns 32 random hexadecimal digits.
  std::string confirm(const RobotOrder& order, Clock::time_point now = Clock::now());

  /// Uses the token up, whether it succeeds or not. Refuses `order_not_confirmed`.
  Expected<void> redeem(const std::string& token, const RobotOrder& order,
                        Clock::time_point now = Clock::now());

  /// After a stop no earlier confirmation is valid.
  void forget_all();

 private:
  struct Entry {
    std::string order;
    Clock::time_point until;
  };
  Clock::duration valid_for_;
  std::map<std::string, Entry> entries_;
};

}  // namespace helicarm::robot
