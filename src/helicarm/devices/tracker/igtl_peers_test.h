// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <thread>

#include <asio.hpp>

#include "helicarm/devices/tracker/igtl_client.h"
#include "helicarm/devices/tracker/igtl_server.h"
#include "helicarm/devices/tracker/pose_board.h"

namespace helicarm::tracker {

/// Waits for a condition on another thread, with a timeout far above the expected time.
template <class Condition>
bool eventually(Condition condition) {
  const double since = monotonic_seconds();
  while (!condition()) {
    if (monotonic_seconds() - since > 20) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

inline std::uint64_t count_of(const Counters& counters, const std::string& name) {
  const auto found = counters.find(name);
  return found == counters.end() ? 0 : found->second;
}

inline std::unique_ptr<IgtlServer> a_server(const IgtlServerOptions& options = {}) {
  return *IgtlServer::start(options);
}

/// A client that stores received messages.
struct Listener {
  explicit Listener(std::uint16_t port, IgtlClientOptions options = {}) {
    options.port = port;
    options.first_pause_s = 0.01;
    client = *IgtlClient::start(options, [this](const IgtlMessage& message, double) {
      const std::lock_guard lock(mutex);
      bytes += encode(message);
      last = message.device;
      ++count;
    });
  }
  bool connects() const {
    return eventually([&] { return client->status().state == LinkState::connected; });
  }
  std::string last_device() {
    const std::lock_guard lock(mutex);
    return last;
  }

  std::mutex mutex;
  std::string bytes, last;
  std::atomic<int> count = 0;
  std::unique_ptr<IgtlClient> client;
};

/// A peer that sends raw bytes.
struct RawPeer {
  asio::io_context io;
  asio::ip::tcp::acceptor acceptor{io, {asio::ip::address_v4::loopback(), 0}};
  asio::ip::tcp::socket socket{io};

  std::uint16_t port() const { return acceptor.local_endpoint().port(); }
  void accept() { socket = acceptor.accept(); }
  void dial(std::uint16_t port) {
    socket.connect({asio::ip::address_v4::loopback(), port});
    socket.set_option(asio::ip::tcp::no_delay(true));
  }
  void write(std::string_view bytes) { asio::write(socket, asio::buffer(bytes)); }
  bool is_disconnected() {
    asio::error_code error;
    char byte = 0;
    while (!error) socket.read_some(asio::buffer(&byte, 1), error);
    return true;
  }
};

inline bool all_connected(const IgtlServer& server, std::size_t clients) {
  return eventually([&] { return server.status().clients == clients; });
}

}  // namespace helicarm::tracker
