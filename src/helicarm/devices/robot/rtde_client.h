// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <thread>

#include "helicarm/devices/robot/robot_driver.h"

namespace helicarm::robot {

struct RtdeOptions {
  std::string address = "127.0.0.1";
  std::uint16_t port = 30004;
  double rate_hz = 125;
  bool commands = true;        ///< write the heartbeat's registers, which only one program can do
  double handshake_s = 1;      ///< timeout of each answer
  double silence_s = 1;        ///< without a state for this time the connection is closed
  double longest_retry_s = 2;  ///< longest pause between attempts; the first is 0.1 s
};

/// A persistent connection to a robot's RTDE port; after an end it is set up again with the whole handshake.
class RtdeClient {
 public:
  RtdeClient(RtdeOptions options, RobotListener listener);
  ~RtdeClient();

 private:
  void run(const std::stop_token& stop);
  Expected<void> serve(const std::stop_token& stop);

  RtdeOptions options_;
  RobotListener listener_;
  std::jthread thread_;
};

}  // namespace helicarm::robot
