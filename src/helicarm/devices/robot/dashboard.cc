// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/dashboard.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/devices/robot/timed_socket.h"

namespace helicarm::robot {
namespace {

struct Exchange {
  std::string_view command;
  std::string_view answer;        ///< its prefix
  std::string_view or_else = {};  ///< alternative prefix
};

// Universal Robots, "Dashboard Server", CB3 and e-Series.
constexpr std::array<Exchange, 10> exchanges = {{
    {"robotmode\n", "Robotmode: "},
    {"safetymode\n", "Safetymode: "},
    {"programState\n", "STOPPED", "P"},  // PLAYING, PAUSED
    {"is in remote control\n", "true", "false"},
    {"PolyscopeVersion\n", "URSoftware "},
    {"stop\n", "Stopped"},
    {"close safety popup\n", "closing safety popup"},
    {"unlock protective stop\n", "Protective stop releasing"},
    {"power on\n", "Powering on"},
    {"brake release\n", "Brake releasing"},
}};

constexpr std::size_t longest_line = 1000;

/// The next line; the remainder stays in `rest`.
Expected<std::string> next_line(TimedSocket& socket, std::string& rest, std::chrono::milliseconds patience) {
  const auto until = std::chrono::steady_clock::now() + patience;
  for (;;) {
    auto line = take_dashboard_line(rest);
    if (!line) return tl::unexpected<Failure>(line.error());
    if (*line) return **std::move(line);
    const auto left = until - std::chrono::steady_clock::now();
    if (left <= left.zero()) return fail(Reason::not_connected, "dashboard: timeout");
    const auto bytes = socket.receive(left);
    if (!bytes) return bytes;
    rest += *bytes;
  }
}

}  // namespace

Expected<std::optional<std::string>> take_dashboard_line(std::string& received) {
  const std::size_t end = received.find('\n');
  if (std::min(end, received.size()) > longest_line)
    return fail(Reason::bad_size, fmt::format("dashboard: a line is over {} characters", longest_line));
  if (end == std::string::npos) return std::nullopt;
  std::string line = received.substr(0, end);
  received.erase(0, end + 1);
  if (line.ends_with('\r')) line.pop_back();
  return without_control_characters(std::move(line));
}

Expected<std::string> checked_answer(DashboardCommand command, std::string answer) {
  const Exchange& exchange = exchanges.at(static_cast<std::size_t>(command));
  if (answer.starts_with(exchange.answer) ||
      (!exchange.or_else.empty() && answer.starts_with(exchange.or_else)))
    return answer;
  return fail(Reason::bad_value, "dashboard: " + answer);
}

Expected<std::string> ask_dashboard(const std::string& address, std::uint16_t port, DashboardCommand command,
                                    std::chrono::milliseconds patience) {
  const Exchange& exchange = exchanges.at(static_cast<std::size_t>(command));
  std::string rest;
  auto socket = TimedSocket::connect(address, port, patience);
  if (!socket) return tl::unexpected<Failure>(socket.error());
  if (auto greeting = next_line(*socket, rest, patience); !greeting) return greeting;
  if (auto sent = socket->send(exchange.command, patience); !sent)
    return tl::unexpected<Failure>(sent.error());
  return next_line(*socket, rest, patience).and_then([&](std::string answer) {
    return checked_answer(command, std::move(answer));
  });
}

}  // namespace helicarm::robot
