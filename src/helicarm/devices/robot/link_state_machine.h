// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>

#include "helicarm/devices/robot/confirmations.h"
#include "helicarm/devices/robot/order_registers.h"
#include "helicarm/devices/robot/robot_state.h"

namespace helicarm::robot {

enum class LinkPhase {
  disconnected,  ///< the robot's position is unknown
  idle,          ///< connected, not unlocked since
  ready,         ///< unlocked: an order with its token may be sent
  starting,      ///< an order is sent, its script has not answered yet
  moving,
  stopped,  ///< latched, with the reason, until unlocked
};
std::string_view name(LinkPhase phase);

enum class LinkEvent {
  connected,     ///< first state of a connection
  lost,          ///< the connection has ended
  stop,          ///< by the user, the robot's state, or the supervision of an order
  unlock,        ///< by the user, allows motion
  order,         ///< confirmed and checked
  acknowledged,  ///< its script reports that it is loaded
  done,
};

enum class LinkAction {
  none,
  refuse,  ///< the event fails and changes nothing
  halt,    ///< count a stop, invalidate all confirmations, no order may move, send the heartbeat -1 (stop)
  permit,  ///< a new number may move once its heartbeats are positive; -1 (stop) until then
  beat,    ///< answer the script's ticks
  rest,    ///< no order may move, send the heartbeat -1 (stop)
};

struct LinkRule {
  LinkPhase to;
  LinkAction action;
};
/// Indexed by phase and event.
using LinkTable = std::array<std::array<LinkRule, 7>, 6>;
extern const LinkTable link_table;

/// Figure of a stale_state that is no delay: by how much the robot's clock jumped, s.
inline constexpr const char* clock_jump_figure = "jumped_s";

/// Seconds.
struct LinkTimes {
  double stale_s = 0.1;            ///< a state older than this is not used
  double program_silence_s = 0.1;  ///< heartbeats end this long after the program's last check
  double start_s = 2;              ///< time limit for a script to begin
};

/// A random session with a random initial count.
OrderNumber new_session();

/// Decides what the link allows, without sockets, threads or a clock: callers pass the time. Every stop is
/// counted. An order carries the count at which its token was redeemed, an unlock the count of the status
/// that its user was shown; they are refused if the count has changed. No motion continues or begins across a
/// stop.
class LinkStateMachine {
 public:
  using Time = Confirmations::Clock::time_point;
  using Stops = std::uint64_t;

  explicit LinkStateMachine(LinkTimes times = {}, OrderNumber session = new_session(),
                            const LinkTable& table = link_table)
      : times_(times), table_(&table), last_(session) {}

  /// Processes a state; returns the answer.
  Heartbeat heard(const RobotState& state, Time now);
  /// The connection has ended.
  void lost(const Failure& why);
  void stop(const Failure& why);
  /// The same on behalf of an order, without effect after another stop; returns the reason of the first.
  Failure stop_order(Stops since, const Failure& why);

  std::string confirm(const RobotOrder& order, Time now) { return confirmations_.confirm(order, now); }
  /// Returns the stop count for the order. Refuses `order_not_confirmed`.
  Expected<Stops> redeem(const std::string& token, const RobotOrder& order, Time now);
  /// Refuses with the reason of a stop that was counted since.
  Expected<void> none_since(Stops since) const;
  /// Refuses as `none_since`, `stale_state`, `robot_stopped`, and `robot_locked` during an order.
  Expected<void> unlock(Stops since, Time now);
  /// Whether an order may be sent now: else `not_connected`, `robot_locked`, `stale_state`, or the stop in
  /// between.
  Expected<void> ready(Stops since, Time now) const;
  /// Permits an order and returns its number for the script, which must be sent under the same lock. Refuses
  /// as `ready`.
  Expected<OrderNumber> begin(Stops since, double foreseen_s, Time now);
  /// Supervises an order: whether it is done. A failure has stopped the robot.
  Expected<bool> look(Stops since, Time now);

  LinkPhase phase() const { return phase_; }
  Stops stops() const { return stops_; }
  const std::optional<RobotState>& state() const { return state_; }
  /// Reason of the last stop: the first one until the robot is unlocked, but a stop of the robot itself goes
  /// before all others.
  const std::optional<Failure>& why() const { return why_; }
  double age_s(Time now) const { return std::chrono::duration<double>(now - heard_).count(); }
  /// Whether an order is sent or in execution.
  bool permits() const { return order_ != OrderNumber{}; }

 private:
  /// False if the table refuses.
  bool apply(LinkEvent event);
  Expected<bool> judge(Time now) const;
  Failure stopped_since() const;
  void stop_by_robot(const Failure& why);

  LinkTimes times_;
  const LinkTable* table_;
  Confirmations confirmations_;
  LinkPhase phase_ = LinkPhase::disconnected;
  Stops stops_ = 0;
  OrderNumber last_;   ///< last number issued
  OrderNumber order_;  ///< number that may move
  bool beats_ = false;
  std::int32_t beat_ = stop_beat;
  std::optional<Failure> why_;
  std::optional<RobotState> state_;
  bool robot_stopped_ = false;
  Time heard_{}, looked_{}, begun_{};
  double begun_s_ = 0, foreseen_s_ = 0;  ///< on the robot's clock
};

}  // namespace helicarm::robot
