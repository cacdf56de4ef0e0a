// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>

#include "helicarm/devices/robot/confirmations.h"
#include "helicarm/devices/robot/order_registers.h"
#include "helicarm/devices/robot/robot_state.h"

namespace helicarm {

enum class LinkPhase {
  disconnected,  ///< where the robot is now is unknown
  idle,          ///< connected; nobody has unlocked it since
  ready,         ///< unlocked: an order with its token may be sent
  starting,      ///< an order is sent, and its script has not answered yet
  moving,
  stopped,  ///< latched, with the reason, until a person unlocks
};
std::string_view name(LinkPhase phase);

enum class LinkEvent {
  connected,     ///< the first state of a connection
  lost,          ///< the connection has ended
  stop,          ///< a person, the robot's state, or the supervision of an order
  unlock,        ///< a person has looked and allows motion
  order,         ///< confirmed and checked
  acknowledged,  ///< its script says that it has come
  done,
};

enum class LinkAction {
  none,
  refuse,  ///< the event fails and changes nothing
  halt,    ///< count a stop, forget all confirmations, no order may move, stop beats
  permit,  ///< a new number may move once it has beats; stop beats until then
  beat,    ///< answer the script's ticks
  rest,    ///< no order may move, stop beats
};

struct LinkRule {
  LinkPhase to;
  LinkAction action;
};
/// By phase and event.
using LinkTable = std::array<std::array<LinkRule, 7>, 6>;
extern const LinkTable link_table;

/// Seconds.
struct LinkTimes {
  double stale_s = 0.1;            ///< a state older than this is no state
  double program_silence_s = 0.1;  ///< the beat ends so long after the program last looked
  double start_s = 2;              ///< limit for a script to begin
};

/// A session drawn at random, and a count in it that begins at random.
OrderNumber new_session();

/// Decides what the link allows, without sockets, threads or a clock: whoever asks brings the time.
/// Every stop is counted. An order carries the count at which its token was redeemed, an unlocking the count
/// at which it began; with another count they are refused. No motion goes on or begins across a stop.
class LinkStateMachine {
 public:
  using Time = Confirmations::Clock::time_point;
  using Stops = std::uint64_t;

  explicit LinkStateMachine(LinkTimes times = {}, OrderNumber session = new_session(),
                            const LinkTable& table = link_table)
      : times_(times), table_(&table), last_(session) {}

  /// A state has come; gives what is to be answered.
  Heartbeat heard(const RobotState& state, Time now);
  /// The connection has ended.
  void lost(const Failure& why);
  void stop(const Failure& why);
  /// The same on behalf of an order, without effect after another stop; gives the reason of the first.
  Failure stop_order(Stops since, const Failure& why);

  std::string confirm(const RobotOrder& order, Time now) { return confirmations_.confirm(order, now); }
  /// The count of stops that the order carries from now on. Refuses `order_not_confirmed`.
  Expected<Stops> redeem(const std::string& token, const RobotOrder& order, Time now);
  /// Refuses `stale_state`, `robot_stopped`, and `robot_locked` while an order is carried out.
  Expected<void> unlock(Stops since, Time now);
  /// Whether an order may be sent now: `not_connected`, `robot_locked`, `stale_state`, or the stop in
  /// between.
  Expected<void> ready(Stops since, Time now) const;
  /// Permits an order: its number, for the script that must be sent under the same lock. Refuses as `ready`.
  Expected<OrderNumber> begin(Stops since, double foreseen_s, Time now);
  /// The supervision of an order looks: whether it is done. A failure has stopped the robot.
  Expected<bool> look(Stops since, Time now);

  LinkPhase phase() const { return phase_; }
  Stops stops() const { return stops_; }
  const std::optional<RobotState>& state() const { return state_; }
  const std::optional<Failure>& why() const { return why_; }  ///< of the last stop
  double age_s(Time now) const { return std::chrono::duration<double>(now - heard_).count(); }
  /// Whether an order is sent or carried out.
  bool permits() const { return order_ != OrderNumber{}; }

 private:
  /// False where the table refuses.
  bool apply(LinkEvent event);
  Expected<bool> judge(Time now) const;
  Failure stopped_since() const;

  LinkTimes times_;
  const LinkTable* table_;
  Confirmations confirmations_;
  LinkPhase phase_ = LinkPhase::disconnected;
  Stops stops_ = 0;
  OrderNumber last_;   ///< that was ever given out
  OrderNumber order_;  ///< that may move
  bool beats_ = false;
  std::int32_t beat_ = stop_beat;
  std::optional<Failure> why_;
  std::optional<RobotState> state_;
  bool robot_stopped_ = false;
  Time heard_{}, looked_{}, begun_{};
  double begun_s_ = 0, foreseen_s_ = 0;  ///< on the robot's clock
};

}  // namespace helicarm
