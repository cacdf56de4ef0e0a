// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/virtual_ur_server.h"

#include <algorithm>
#include <optional>

#include <fmt/format.h>

#include "helicarm/core/real_time.h"
#include "helicarm/virtual_devices/robot/virtual_ur_messages.h"

namespace helicarm::robot {
namespace {

using asio::ip::tcp;

// Without file descriptors an immediate retry would use a whole core.
constexpr std::chrono::milliseconds retry_delay{100};

}  // namespace

VirtualUr::Server::~Server() {
  io_.stop();
  if (thread_.joinable()) thread_.join();
}

Expected<void> VirtualUr::Server::listen() {
  const std::array<std::pair<std::uint16_t, Handle>, ports> wanted = {
      {{options_.rtde_port, &Server::hear_rtde},
       {options_.dashboard_port, &Server::hear_dashboard},
       {options_.script_port, &Server::hear_script},
       {options_.primary_port, &Server::hear_script}}};
  std::error_code error;
  const auto ip = asio::ip::make_address(options_.address, error);
  if (error) return fail(Reason::bad_value, "\"" + options_.address + "\" is not an address");
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    tcp::acceptor& acceptor = acceptors_[i];
    const tcp::endpoint here(ip, wanted[i].first);
    if (acceptor.open(here.protocol(), error) ||
        acceptor.set_option(tcp::acceptor::reuse_address(true), error) || acceptor.bind(here, error) ||
        acceptor.listen(16, error))
      return fail(
          error == asio::error::address_in_use ? Reason::port_taken : Reason::bad_value,
          fmt::format("cannot listen on {}:{}: {}", options_.address, wanted[i].first, error.message()));
    accept(i, wanted[i].second);
  }
  if (!options_.lockstep) tick(std::chrono::steady_clock::now());
  thread_ = std::thread([this] {
    std::optional<RealTime> priority;
    if (!options_.lockstep) priority.emplace();
    io_.run();
  });
  return {};
}

void VirtualUr::Server::set(RobotFault fault, bool on) {
  controller_.set(fault, on);
  if (fault == RobotFault::cut_cable && !on)
    for (const auto& client : clients_) client->close();
  if (!on && options_.lockstep) tell_state();
}

void VirtualUr::Server::step() {
  controller_.step();
  tell_state();
  tell_modes();
}

void VirtualUr::Server::hold_dashboard(bool on) {
  dashboard_held_ = on;
  for (const auto& [client, line] : std::exchange(held_questions_, {})) answer_dashboard(client, line);
}

VirtualTruth VirtualUr::Server::truth() const {
  VirtualTruth truth{controller_.state(),        {},
                     controller_.moving(),       controller_.rest_since_s(),
                     controller_.script_error(), controller_.waiting_scripts(),
                     held_questions_.size()};
  truth.base_from_tip = base_from_flange(options_.arm, truth.state.joints) * options_.tool.flange_from_tcp;
  return truth;
}

VirtualUrCounters VirtualUr::Server::counters() const {
  VirtualUrCounters counters = counters_;
  counters.clients = clients_.size();
  return counters;
}

void VirtualUr::Server::accept(std::size_t port, Handle handle) {
  acceptors_[port].async_accept([this, port, handle](const std::error_code& error, tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error) {
      welcome(port, std::move(socket), handle);
      return accept(port, handle);
    }
    ++counters_.accept_failures;
    retry_timers_[port].expires_after(retry_delay);
    retry_timers_[port].async_wait([this, port, handle](const std::error_code& stopped) {
      if (!stopped) accept(port, handle);
    });
  });
}

void VirtualUr::Server::welcome(std::size_t port, tcp::socket socket, Handle handle) {
  ++counters_.connections;
  make_room(port);
  std::error_code ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  auto client = std::make_shared<VirtualUrClient>(std::move(socket), port, [this](const std::string& line) {
    ++counters_.cut;
    note(line);
  });
  clients_.push_back(client);
  if (port == dashboard) client->send("Connected: Universal Robots Dashboard Server\n");
  if (port == script) client->send(empty_robot_state);
  if (port == primary) client->send(version_message(controller_.version()));
  read(client, handle);
}

/// On a full port the oldest client that does not command is disconnected.
void VirtualUr::Server::make_room(std::size_t port) {
  std::erase_if(clients_, [](const auto& one) { return !one->socket.is_open(); });
  if (std::ranges::count(clients_, port, &VirtualUrClient::port) < most_clients_of_port) return;
  const auto oldest =
      std::ranges::find_if(clients_, [port](const auto& one) { return one->port == port && !one->commands; });
  (*oldest)->cut("replaced by another client");
  clients_.erase(oldest);
}

void VirtualUr::Server::note(const std::string& line) {
  if (const auto left_out = lines_.pass())
    options_.on_notice(*left_out == 0 ? line : fmt::format("{} ({} lines omitted)", line, *left_out));
}

void VirtualUr::Server::read(const std::shared_ptr<VirtualUrClient>& client, Handle handle) {
  client->socket.async_read_some(asio::buffer(client->buffer),
                                 [this, client, handle](const std::error_code& error, std::size_t size) {
                                   if (error) {
                                     client->close();
                                     client->started = client->commands = false;
                                     std::erase(clients_, client);
                                     return;
                                   }
                                   if (!controller_.has(RobotFault::cut_cable))
                                     (this->*handle)(*client, {client->buffer.data(), size});
                                   if (client->socket.is_open()) read(client, handle);
                                 });
}

/// A stalled machine stalls the robot's clock too: otherwise it would miss heartbeats that could not be
/// sent.
void VirtualUr::Server::tick(std::chrono::steady_clock::time_point due) {
  timer_.expires_at(due);
  timer_.async_wait([this, due](const std::error_code& error) {
    if (error) return;
    step();
    const std::chrono::nanoseconds period(static_cast<long>(1e9 / options_.controller.rate_hz));
    tick(std::max(due + period, std::chrono::steady_clock::now() - 2 * period));
  });
}

void VirtualUr::Server::hear_dashboard(VirtualUrClient& client, std::string_view bytes) {
  client.text += bytes;
  for (std::size_t end = client.text.find('\n'); end != std::string::npos; end = client.text.find('\n')) {
    const std::string line = client.text.substr(0, end);
    client.text.erase(0, end + 1);
    answer_dashboard(client.shared_from_this(), line);
  }
  if (client.text.size() > 1000) client.cut("line over 1000 bytes");
}

void VirtualUr::Server::answer_dashboard(const std::shared_ptr<VirtualUrClient>& client,
                                         const std::string& line) {
  constexpr std::size_t most_held = 1000;
  if (dashboard_held_ && held_questions_.size() >= most_held)
    client->cut("over 1000 commands while the dashboard is held");
  else if (dashboard_held_)
    held_questions_.emplace_back(client, line);
  else if (client->socket.is_open())
    client->send(controller_.dashboard(line) + "\n");
}

void VirtualUr::Server::hear_script(VirtualUrClient& client, std::string_view bytes) {
  client.text += bytes;
  constexpr std::string_view last = "\nend\n";
  for (std::size_t end = client.text.find(last); end != std::string::npos; end = client.text.find(last)) {
    controller_.run_script(client.text.substr(0, end + last.size()));
    client.text.erase(0, end + last.size());
  }
  if (client.text.size() > 1 << 17) client.cut("script over 128 KiB");
}

/// To the clients of the primary port.
void VirtualUr::Server::tell_modes() {
  constexpr double interval_s = 0.1;
  const double now_s = controller_.time_s();
  if (now_s < modes_due_s_ && modes_due_s_ <= now_s + interval_s) return;
  modes_due_s_ = now_s + interval_s;
  if (controller_.has(RobotFault::cut_cable)) return;
  const std::string bytes = modes_message(controller_.state());
  for (const auto& client : clients_)
    if (client->port == primary) client->send(bytes);
}

}  // namespace helicarm::robot
