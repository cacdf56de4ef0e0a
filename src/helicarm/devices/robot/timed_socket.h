// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "helicarm/core/failure.h"

namespace helicarm::robot {

/// A TCP connection with a timeout for every operation. All fail with `not_connected`.
class TimedSocket {
 public:
  using Duration = std::chrono::steady_clock::duration;

  /// `address` is numeric, such as 192.168.0.2 or ::1, or "localhost": no name lookup.
  static Expected<TimedSocket> connect(const std::string& address, std::uint16_t port, Duration patience);
  TimedSocket(TimedSocket&&) noexcept;
  TimedSocket& operator=(TimedSocket&&) noexcept;
  ~TimedSocket();

  Expected<void> send(std::string_view bytes, Duration patience);
  /// Received bytes; empty if none arrive in this time.
  Expected<std::string> receive(Duration patience);

 private:
  struct Parts;
  explicit TimedSocket(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace helicarm::robot
