// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/igtl_message.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm::tracker {

struct IgtlServerOptions {
  std::string address = "127.0.0.1";  ///< numeric; the protocol has neither authentication nor encryption
  std::uint16_t port = 0;             ///< 0: any free port
  /// On a full server the client idle for longest, and for at least `stall_s`, is replaced.
  std::size_t max_clients = 32;
  std::size_t queue_messages = 256;                ///< queue of a slow client; beyond, the oldest are dropped
  std::size_t queue_bytes = std::size_t{8} << 20;  ///< likewise
  double stall_s = 5;  ///< a client that reads nothing for this time is disconnected
  std::uint64_t body_bytes = std::uint64_t{1} << 20;  ///< of a client's message; beyond, it is disconnected
  std::size_t unsent_messages = 1024;  ///< queue to the server's thread; beyond, the newest are dropped
  /// Send TDATA and QTDATA only to clients that sent STT_, of the type they asked for; others receive a
  /// TRANSFORM for each tool. False: as they are, to all.
  bool tracking_on_request = true;
  /// Log line for each client that was disconnected or rejected, at most 20 per second.
  std::function<void(const std::string&)> on_notice = [](const std::string&) {};
};

struct IgtlServerStatus {
  std::size_t clients = 0;
  /// "connections", "refused", "evicted", "unsent" messages and, over all connections, those of
  /// IgtlConnection
  Counters counters;
};

/// An OpenIGTLink server on its own thread. It answers STT_, STP_ and GET_STATUS itself; clients cannot block
/// each other.
class IgtlServer {
 public:
  using OnMessage = std::function<void(const IgtlMessage&)>;

  /// Listens on return. Fails with `bad_value` (address) and `port_taken`. `on_message` and `on_notice` are
  /// called on the server's thread; they must not call stop().
  static Expected<std::unique_ptr<IgtlServer>> start(const IgtlServerOptions& options,
                                                     OnMessage on_message = {});
  ~IgtlServer();

  std::uint16_t port() const;
  /// To all clients, tracking of the type and at most at the rate that each requested. A tool whose matrix is
  /// no rigid motion is absent where a quaternion is sent. Thread-safe.
  void send(const IgtlMessage& message);
  IgtlServerStatus status() const;  ///< thread-safe
  /// Returns at once, with the thread ended and the port free; queued messages are not sent.
  void stop();

 private:
  struct Impl;
  explicit IgtlServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace helicarm::tracker
