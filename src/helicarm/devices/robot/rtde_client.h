// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>

#include "helicarm/devices/robot/rtde_message.h"

namespace helicarm {

struct RtdeOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 30004;
  double rate_hz = 125;
  bool commands = true;        ///< take the heartbeat's register, which one program alone can have
  double handshake_s = 1;      ///< patience with each answer
  double silence_s = 1;        ///< without a state for so long, the connection is given up
  double longest_retry_s = 2;  ///< first tries again after 0.1 s, then ever later
};

/// What the client tells, on its own thread: each state as it comes, and each end of a connection with the
/// reason. After an end it connects anew, with the whole handshake.
struct RtdeListener {
  std::function<void(const ControllerVersion&)> connected;
  std::function<void(const RobotState&)> state;
  std::function<void(const Failure&)> lost;
};

/// A lasting connection to a robot's RTDE. It answers every state with the heartbeat's register, whose value
/// changes only while `beat_for` allows: neither a frozen stream nor a frozen program keeps the robot going.
class RtdeClient {
 public:
  RtdeClient(RtdeOptions options, RtdeListener listener);
  ~RtdeClient();

  /// From now on; zero stops the beat at once.
  void beat_for(std::chrono::steady_clock::duration time);
  /// Ends the beat and tells the script to stop now, rather than when it misses the beat.
  void halt();

 private:
  void run(const std::stop_token& stop);
  Expected<void> serve(const std::stop_token& stop);

  RtdeOptions options_;
  RtdeListener listener_;
  std::atomic<std::chrono::steady_clock::time_point> beat_until_{};
  std::atomic<int> halts_{0};  ///< messages that will still say so
  std::jthread thread_;
};

}  // namespace helicarm
