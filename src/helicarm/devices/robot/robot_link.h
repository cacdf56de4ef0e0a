// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/devices/robot/check_order.h"
#include "helicarm/devices/robot/follow_target.h"
#include "helicarm/devices/robot/link_state_machine.h"
#include "helicarm/devices/robot/rtde_client.h"
#include "helicarm/devices/robot/timed_socket.h"
#include "helicarm/devices/robot/tool_track.h"

namespace helicarm {

struct RobotConfig {
  RobotModel model = ur5();
  std::string address = "127.0.0.1";
  std::uint16_t rtde_port = 30004;
  std::uint16_t dashboard_port = 29999;
  std::uint16_t script_port = 30002;
  double stale_s = 0.1;            ///< a state older than this is no state
  double program_silence_s = 0.1;  ///< the heartbeat ends so long after this program last looked
  double lost_s = 1;               ///< without an answer or a state for so long, it is connected anew
  double start_s = 2;              ///< limit for a script to begin
  double mismatch_mm = 0.5;        ///< of the arm's kinematics, from which on it is told
  RobotLimits limits = {};
};

/// Whether a motion may go on. Asked before the script is sent and then with each state.
using Watch = std::function<Expected<void>()>;

struct RobotLinkStatus {
  LinkPhase phase = LinkPhase::disconnected;
  std::optional<Failure> why;  ///< of the last stop or end of the connection
  std::optional<RobotState> state;
  double age_s = 0;  ///< of the state
  ControllerVersion version;
  std::vector<Warning> warnings;
};

/// A robot over its three ports, and the lock on its motion: sockets and threads around a `LinkStateMachine`,
/// which decides. Nothing moves but by `execute`; whatever stops the robot, or ends the connection, is
/// latched and undone by `unlock` alone. All members may be called from any thread.
class RobotLink {
 public:
  explicit RobotLink(RobotConfig config);
  ~RobotLink();

  RobotLinkStatus status() const;
  /// Waits until it is connected and has a state; the reason why not after this time.
  Expected<RobotState> wait_connected(std::chrono::steady_clock::duration patience) const;
  /// Where the robot had its tool lately.
  const ToolTrack& track() const { return track_; }

  /// A person has looked at the robot and allows motion. Releases a protective stop, which the robot itself
  /// allows 5 s after it; refuses while the robot says that it may not move (`robot_stopped`), in local mode
  /// (`robot_locked`), without a connection, or after a stop during the call.
  Expected<void> unlock(const std::string& who);

  /// A token for this order, for the person who has seen its preview.
  std::string confirm(const RobotOrder& order);

  /// Carries a confirmed order out and returns when the tool is where it should be. With corrections it then
  /// follows the target by `measure`, and gives every miss; without, by the robot's own pose. Refuses,
  /// without any motion, as `check_order`, `order_not_confirmed` and `robot_locked`. What goes wrong on the
  /// way, or `watch` has against it, stops the robot and is latched. A stop ends it for good, also when the
  /// robot is unlocked before this returns.
  Expected<std::vector<Miss>> execute(const RobotOrder& order, const std::string& token,
                                      const Measure& measure = {}, const Watch& watch = {});

  /// Stops the robot at once, from any thread.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;

  using Stops = LinkStateMachine::Stops;

  Expected<RobotState> run(const RobotOrder& order, Stops since, const Watch& watch);
  Expected<void> send(const RobotOrder& order, Stops since);
  Expected<RobotState> supervise(Stops since, const Watch& watch);
  Expected<void> correct(const RobotOrder& order, Stops since, const RigidTransform& tcp_from_new,
                         const Watch& watch);
  Expected<void> refuse_local_mode() const;
  void changed();

  RobotConfig config_;
  ToolTrack track_;
  std::mutex executing_;
  mutable std::mutex guard_;  ///< of all that follows
  mutable std::condition_variable news_;
  LinkStateMachine machine_;
  ControllerVersion version_;
  std::optional<TimedSocket> script_socket_;
  RtdeClient client_;  ///< last: its thread uses all the others
};

}  // namespace helicarm
