// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <asio.hpp>
#include <fmt/format.h>

#include "helicarm/devices/robot/rtde_message.h"

namespace helicarm::robot {

/// A client of one of the virtual robot's ports, on its socket's thread.
struct VirtualUrClient : std::enable_shared_from_this<VirtualUrClient> {
  static constexpr std::size_t longest_backlog = 1 << 20;

  VirtualUrClient(asio::ip::tcp::socket connected_socket, std::size_t of_port,
                  std::function<void(const std::string& line)> on_cut)
      : socket(std::move(connected_socket)), port(of_port), on_disconnect(std::move(on_cut)) {
    std::error_code gone;
    const auto peer = socket.remote_endpoint(gone);
    name = fmt::format("client {}:{}", peer.address().to_string(), peer.port());
  }

  void send(std::string_view bytes) {
    if (!socket.is_open()) return;
    waiting += bytes;
    if (waiting.size() > longest_backlog) return cut("does not read");
    if (sending.empty()) send_waiting();
  }
  /// Whether the state of this time is due at the requested rate.
  bool takes(double now_s, double period_s) {
    // At once at the beginning, after a jump of the clock, and always at the full rate.
    if (interval_s < 1.5 * period_s || std::abs(due_s - now_s) > interval_s + period_s) due_s = now_s;
    if (now_s < due_s - period_s / 2) return false;
    due_s += interval_s;
    return true;
  }
  /// Closes the connection because of the client's behaviour.
  void cut(const std::string& why) {
    if (!socket.is_open()) return;
    close();
    on_disconnect(fmt::format("{}: disconnected: {}", name, why));
  }
  void close() {
    std::error_code ignored;
    socket.close(ignored);
    waiting = {};
    text = {};
    started = commands = false;
  }

  asio::ip::tcp::socket socket;
  const std::size_t port;  ///< 0 RTDE, 1 dashboard, 2 script, 3 primary
  std::string name;        ///< its address
  std::array<char, 4096> buffer{};
  std::string waiting, sending;
  std::string text;  ///< dashboard and script: received text
  RtdeStream stream;
  std::vector<std::string> names;  ///< RTDE: requested variables
  double interval_s = 0;           ///< RTDE: requested between states
  double due_s = 0;                ///< of the next state, on the robot's clock
  bool started = false;
  bool commands = false;
  int unanswered = 0;  ///< unanswered states, in lockstep

 private:
  void send_waiting() {
    sending.swap(waiting);
    asio::async_write(socket, asio::buffer(sending),
                      [self = shared_from_this()](const std::error_code& error, std::size_t) {
                        self->sending.clear();
                        if (error) return self->close();
                        if (!self->waiting.empty()) self->send_waiting();
                      });
  }

  std::function<void(const std::string& line)> on_disconnect;
};

}  // namespace helicarm::robot
