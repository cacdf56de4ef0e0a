// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/devices/robot/check_order.h"
#include "helicarm/devices/robot/follow_target.h"
#include "helicarm/devices/robot/link_state_machine.h"
#include "helicarm/devices/robot/robot_driver.h"
#include "helicarm/devices/robot/tool_track.h"

namespace helicarm::robot {

struct RobotConfig : RobotAddress {
  double stale_s = 0.1;            ///< a state older than this is not used
  double program_silence_s = 0.1;  ///< heartbeats end this long after the program's last check
  double start_s = 2;              ///< time limit for a script to begin
  double mismatch_mm = 0.5;        ///< kinematic mismatch above which a warning is given
  RobotLimits limits = {};
};

/// Whether a motion may continue. Called before the script is sent and then with each state.
using Watch = std::function<Expected<void>()>;

struct RobotLinkStatus {
  LinkPhase phase = LinkPhase::disconnected;
  std::optional<Failure> why;  ///< of the last stop or disconnection
  std::optional<RobotState> state;
  double age_s = 0;  ///< of the state
  ControllerVersion version;
  std::vector<Warning> warnings;
  LinkStateMachine::Stops stops = 0;  ///< counted so far: what `RobotLink::unlock` resets
};

/// A robot behind its driver, and the lock on its motion: threads around a `LinkStateMachine`, which decides.
/// Only `execute` causes motion; any stop or disconnection is latched and reset by `unlock` only. All members
/// are thread-safe.
class RobotLink {
 public:
  /// On the driver of the configured model. Throws BadInput as `open_driver`.
  explicit RobotLink(RobotConfig config);
  RobotLink(RobotConfig config, std::unique_ptr<RobotDriver> driver);
  ~RobotLink();

  RobotLinkStatus status() const;
  /// Waits for a connection and a state; fails with the reason after `patience`.
  Expected<RobotState> wait_connected(std::chrono::steady_clock::duration patience) const;
  /// Recent tool poses.
  const ToolTrack& track() const { return track_; }

  /// The user has inspected the robot, whose status was `shown`, and allows motion. Releases a protective
  /// stop, which the robot permits 5 s after it; refuses with its reason a stop that the status did not hold,
  /// if the robot's state does not allow motion (`robot_stopped`), in local mode (`robot_locked`), and
  /// without a connection.
  Expected<void> unlock(const std::string& who, const RobotLinkStatus& shown);

  /// Token for this order, for the user who has seen its preview.
  std::string confirm(const RobotOrder& order);

  /// Executes a confirmed order and returns when the tool is at its target. With corrections it then follows
  /// the target by `measure` and returns every error; without, by the robot's own pose. Refuses, without
  /// motion, as `check_order`, `order_not_confirmed` and `robot_locked`. A failure during motion, or of
  /// `watch`, stops the robot and is latched. A stop ends the call for good, even if the robot is unlocked
  /// before it returns.
  Expected<std::vector<Miss>> execute(const RobotOrder& order, const std::string& token,
                                      const Measure& measure = {}, const Watch& watch = {});

  /// Stops the robot immediately; thread-safe.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;

  using Stops = LinkStateMachine::Stops;

  Expected<RobotState> run(const RobotOrder& order, Stops since, const Watch& watch);
  Expected<void> send(const RobotOrder& order, Stops since);
  Expected<RobotState> supervise(Stops since, const Watch& watch);
  Expected<void> correct(const RobotOrder& order, Stops since, const geometry::RigidTransform& tcp_from_new,
                         const Watch& watch);
  void changed();

  RobotConfig config_;
  ToolTrack track_;
  std::mutex executing_;
  mutable std::mutex guard_;  ///< guards all members below
  mutable std::condition_variable news_;
  LinkStateMachine machine_;
  ControllerVersion version_;
  std::unique_ptr<OrderChannel> channel_;  ///< of the order that may move
  std::unique_ptr<RobotDriver> driver_;    ///< last: its thread uses all others
};

}  // namespace helicarm::robot
