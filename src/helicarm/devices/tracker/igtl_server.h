// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "helicarm/core/failure.h"
#include "helicarm/devices/tracker/igtl_message.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm {

struct IgtlServerOptions {
  std::string address = "127.0.0.1";  ///< numeric; the protocol has neither password nor secrecy
  std::uint16_t port = 0;             ///< 0: any that is free
  /// Of a full server the one makes room that has sent and taken nothing for longest, and for `stall_s`.
  std::size_t max_clients = 32;
  std::size_t queue_messages = 256;                ///< held for a slow client; the oldest are dropped beyond
  std::size_t queue_bytes = std::size_t{8} << 20;  ///< likewise
  double stall_s = 5;                              ///< a client that takes nothing for so long is cut off
  std::uint64_t body_bytes = std::uint64_t{1} << 20;  ///< of a client's message; it is cut off beyond
  std::size_t unsent_messages = 1024;  ///< that wait for the server's thread; the newest are dropped beyond
  bool tracking_on_request = true;     ///< TDATA and QTDATA go only to clients that sent STT_
  /// A line for a log on each client that was cut off or turned away, at most 20 a second.
  std::function<void(const std::string&)> on_notice = [](const std::string&) {};
};

struct IgtlServerStatus {
  std::size_t clients = 0;
  /// "connections", "refused", "evicted", "unsent" messages and, over all connections, those of
  /// IgtlConnection
  Counters counters;
};

/// An OpenIGTLink server on a thread of its own. It answers STT_, STP_ and GET_STATUS by itself; no client
/// can hold up another.
class IgtlServer {
 public:
  using OnMessage = std::function<void(const IgtlMessage&)>;

  /// Listens when it returns. Fails with `bad_value` (address) and `port_taken`. `on_message` and
  /// `on_notice` are called on the server's thread; they must not call stop().
  static Expected<std::unique_ptr<IgtlServer>> start(const IgtlServerOptions& options,
                                                     OnMessage on_message = {});
  ~IgtlServer();

  std::uint16_t port() const;
  /// To all clients, tracking no faster than each asked for. From any thread.
  void send(const IgtlMessage& message);
  IgtlServerStatus status() const;  ///< from any thread
  /// Returns at once, with the thread ended and the port free; what is queued is not sent.
  void stop();

 private:
  struct Impl;
  explicit IgtlServer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace helicarm
