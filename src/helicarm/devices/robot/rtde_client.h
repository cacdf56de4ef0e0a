// SPDX-License-Identifier: Apache-2.0
#pragma once

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
  bool commands = true;        ///< take the heartbeat's registers, which one program alone can have
  double handshake_s = 1;      ///< patience with each answer
  double silence_s = 1;        ///< without a state for so long, the connection is given up
  double longest_retry_s = 2;  ///< first tries again after 0.1 s, then ever later
};

/// What the client tells, on its own thread: each state as it comes, which it answers with the heartbeat it
/// is given, and each end of a connection with the reason. After an end it connects anew, with the whole
/// handshake.
struct RtdeListener {
  std::function<void(const ControllerVersion&)> connected;
  std::function<Heartbeat(const RobotState&)> state;
  std::function<void(const Failure&)> lost;
};

/// A lasting connection to a robot's RTDE.
class RtdeClient {
 public:
  RtdeClient(RtdeOptions options, RtdeListener listener);
  ~RtdeClient();

 private:
  void run(const std::stop_token& stop);
  Expected<void> serve(const std::stop_token& stop);

  RtdeOptions options_;
  RtdeListener listener_;
  std::jthread thread_;
};

}  // namespace helicarm
