// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <asio.hpp>

#include "helicarm/devices/tracker/igtl_stream.h"

namespace helicarm::tracker {

/// Limits of a connection's buffers.
struct ConnectionLimits {
  std::size_t messages = 256;  ///< send queue; beyond, the oldest are dropped
  std::size_t bytes = std::size_t{64} << 20;
  double stall_s = 5;  ///< a peer that reads nothing for this time is disconnected
  std::uint64_t body_bytes = std::uint64_t{64} << 20;  ///< of an incoming message
};

/// A numeric address; names are not looked up, because a lookup can block for seconds. "localhost" is
/// 127.0.0.1.
Expected<asio::ip::tcp::endpoint> endpoint_of(const std::string& address, std::uint16_t port);

void add_counters(Counters& to, const Counters& more);

/// One connected socket with its stream and its queue. All calls and callbacks are on the thread of the
/// socket's io_context, except counters().
class IgtlConnection : public std::enable_shared_from_this<IgtlConnection> {
 public:
  struct Handlers {
    IgtlStream::Sink on_message;
    std::function<void(const std::string& why)> on_closed;
  };

  IgtlConnection(asio::ip::tcp::socket socket, const ConnectionLimits& limits)
      : socket_(std::move(socket)), limits_(limits), stream_(limits.body_bytes) {}

  void start(Handlers handlers);
  void send(std::shared_ptr<const std::string> bytes);
  void close(const std::string& why);
  /// Closes the connection because of the peer's behaviour; counted as "cut".
  void cut(const std::string& why);
  bool was_cut() const { return cut_; }

  /// Time of the newest data, or of the connection's start; monotonic_seconds().
  double heard_s() const { return heard_s_; }
  /// When the peer last sent or read data.
  double active_s() const { return std::max(heard_s_, taken_s_); }
  /// Counters of the stream, "bytes", "sent" and "dropped" messages, "cut" connections. Thread-safe.
  Counters counters() const;

 private:
  void read();
  void take(std::size_t size);
  void write();
  void publish();

  asio::ip::tcp::socket socket_;
  ConnectionLimits limits_;
  Handlers handlers_;
  IgtlStream stream_;
  std::array<char, 65536> segment_;
  std::deque<std::shared_ptr<const std::string>> queue_;
  std::vector<std::shared_ptr<const std::string>> in_flight_;
  std::size_t queued_bytes_ = 0;
  double writing_since_ = 0;
  double heard_s_ = 0, taken_s_ = 0;
  std::uint64_t bytes_ = 0, sent_ = 0, dropped_ = 0;
  bool open_ = false, cut_ = false;

  mutable std::mutex mutex_;
  Counters published_;
};

}  // namespace helicarm::tracker
