// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/core/random.h"
#include "helicarm/devices/robot/link_state_machine.h"

namespace helicarm::robot {

/// Simulated time in steps; a UR5 has periods of 8 ms.
inline constexpr int step_ms = 4, steps_per_period = 2;  // a UR5 has periods of 8 ms

/// The script's rules, each of which a test can break.
struct ScriptRules {
  bool number_before = true;  ///< waits until its number is in the registers
  bool number_during = true;
  bool once = true;  ///< ends immediately if it has begun before
  bool stop_beat = true;
  bool age = true;                        ///< a heartbeat's age is checked
  int patience = 10, longest_wait = 125;  ///< ticks
};

/// The script of script.cc as plain code. A test compares the two.
class ScriptModel {
 public:
  ScriptModel(OrderNumber number, const ScriptRules& rules) : number_(number), rules_(rules) {}

  /// One period. `rests`: its moves have ended, or its braking has.
  void step(const Heartbeat& in, ScriptReport& out, bool rests) {
    if (!come_) return come(in, out);
    if (braking_) {
      if (!rests) return;
      out.stage = ScriptStage::stopped;
      ended_ = true;
      return;
    }
    out.tick = ++tick_;
    const bool ours = in.order == number_ || !rules_.number_during;
    const bool young = (in.beat <= tick_ && tick_ - in.beat < rules_.patience) || !rules_.age;
    const bool live = (in.beat > 0 || !rules_.stop_beat) && young;
    if (ours && live) {
      if (!moving_) out.stage = ScriptStage::begun;
      begins_ = !moving_;
      moving_ = true;
    } else if (moving_) {
      moving_ = begins_ = false;
      braking_ = true;
      return;
    } else if (!ours || tick_ > rules_.longest_wait) {
      ended_ = true;
      return;
    }
    if (out.stage == ScriptStage::done) {
      moving_ = false;
      ended_ = true;
    } else if (moving_ && !begins_ && rests) {
      out.stage = ScriptStage::done;
    }
  }
  OrderNumber number() const { return number_; }
  bool drives() const { return moving_; }
  bool begins() const { return begins_; }  ///< its motion begins in this period
  bool braking() const { return braking_ && !ended_; }
  bool ended() const { return ended_; }

 private:
  void come(const Heartbeat& in, ScriptReport& out) {
    ended_ = rules_.once && waited_ == 0 && out.order == number_;
    if (!ended_ && rules_.number_before && in.order != number_) {
      ended_ = waited_++ > rules_.longest_wait;
      return;
    }
    come_ = true;
    if (!ended_) out = {ScriptStage::waiting, number_, 0};
  }

  OrderNumber number_;
  ScriptRules rules_;
  std::int32_t tick_ = 0;
  int waited_ = 0;
  bool come_ = false, moving_ = false, begins_ = false, braking_ = false, ended_ = false;
};

/// Channel quality in one sequence.
struct Disturbance {
  double loss = 0, twice = 0, late = 0;  ///< probabilities
  int jitter = 1, longest = 1;           ///< delays in steps: usual, and of late messages
};

/// Delivers messages late, twice, in another order, or not at all.
template <class T>
class Channel {
 public:
  void send(const T& message, int now, const Disturbance& disturbance, RandomStream& random) {
    if (random.uniform() < disturbance.loss) return;
    const auto due = [&] {
      const int range = random.uniform() < disturbance.late ? disturbance.longest : disturbance.jitter;
      return now + static_cast<int>(random.index(static_cast<std::uint32_t>(range + 1)));
    };
    waiting_.push_back({due(), message});
    if (random.uniform() < disturbance.twice) waiting_.push_back({due(), message});
  }
  template <class Take>
  void deliver(int now, Take take) {
    for (std::size_t i = 0; i < waiting_.size();) {
      if (waiting_[i].due > now) {
        ++i;
        continue;
      }
      const T message = waiting_[i].message;
      waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(i));
      take(message);
    }
  }

 private:
  struct Entry {
    int due;
    T message;
  };
  std::vector<Entry> waiting_;
};

}  // namespace helicarm::robot
