// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/virtual_ur.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <future>
#include <list>
#include <thread>

#include <asio.hpp>
#include <fmt/format.h>

#include "helicarm/core/big_endian.h"
#include "helicarm/core/line_limit.h"
#include "helicarm/devices/robot/rtde_message.h"
#include "helicarm/devices/robot/virtual_ur_client.h"

namespace helicarm::robot {
namespace {

using asio::ip::tcp;

// Without file descriptors an immediate retry would use a whole core.
constexpr std::chrono::milliseconds retry_delay{100};
constexpr std::uint8_t state_recipe = 1, heartbeat_recipe = 2;
constexpr std::string_view empty_robot_state("\0\0\0\5\x10", 5);
constexpr std::size_t ports = 4, primary = 3;

/// Size and type before a message or package of the client interface.
std::string framed(std::uint8_t type, const std::string& content) {
  return BigEndianWriter().put(static_cast<std::uint32_t>(content.size() + 5)).put(type).put(content).bytes();
}

/// Version message of the primary port (Universal Robots, client interface).
std::string version_message(const std::array<std::uint32_t, 4>& version) {
  constexpr std::uint8_t robot_message = 20, from_robot = 254, version_kind = 3;
  const std::string project = "URControl", date = "virtual";
  return framed(robot_message, BigEndianWriter()
                                   .put(std::uint64_t{0})
                                   .put(from_robot)
                                   .put(version_kind)
                                   .put(static_cast<std::uint8_t>(project.size()))
                                   .put(project)
                                   .put(static_cast<std::uint8_t>(version[0]))
                                   .put(static_cast<std::uint8_t>(version[1]))
                                   .put(version[2])
                                   .put(version[3])
                                   .put(date)
                                   .bytes());
}

/// Robot state message with robot mode data as its only package.
std::string modes_message(const RobotState& state) {
  constexpr std::uint8_t robot_state = 16, mode_data = 0, position_control = 0;
  const auto flag = [](bool on) { return static_cast<std::uint8_t>(on); };
  const double slider = state.speed_scaling;
  return framed(
      robot_state,
      framed(mode_data,
             BigEndianWriter()
                 .put(static_cast<std::uint64_t>(std::isfinite(state.time_s) ? 1e6 * state.time_s : 0))
                 .put(flag(true))
                 .put(flag(true))
                 .put(flag(state.robot_mode >= RobotMode::power_on))
                 .put(flag(state.safety_mode == SafetyMode::robot_emergency_stop))
                 .put(flag(state.safety_mode == SafetyMode::protective_stop))
                 .put(flag(state.runtime == RuntimeState::playing))
                 .put(flag(false))
                 .put(static_cast<std::uint8_t>(state.robot_mode))
                 .put(position_control)
                 .put(slider)
                 .put(slider)
                 .put(1.0)
                 .put(std::uint8_t{0})
                 .bytes()));
}

Heartbeat take_heartbeat(BigEndianReader& reader) {
  Heartbeat heartbeat;
  for (std::int32_t* part : {&heartbeat.beat, &heartbeat.order.session, &heartbeat.order.count})
    *part = reader.take<std::int32_t>();
  return heartbeat;
}

}  // namespace

class VirtualUr::Server {
 public:
  explicit Server(const VirtualUrOptions& options)
      : options_(options), controller_(options.controller, options.tool, options.joints) {}
  ~Server() {
    io_.stop();
    if (thread_.joinable()) thread_.join();
  }

  Expected<void> listen() {
    using Handle = void (Server::*)(VirtualUrClient&, std::string_view);
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
    thread_ = std::thread([this] { io_.run(); });
    return {};
  }

  std::uint16_t port(std::size_t i) const { return acceptors_[i].local_endpoint().port(); }

  /// Runs on the server's own thread and waits for it.
  template <class Work>
  auto there(Work work) {
    std::packaged_task<std::invoke_result_t<Work>()> task(std::move(work));
    auto result = task.get_future();
    asio::post(io_, [&task] { task(); });
    return result.get();
  }

  void set(RobotFault fault, bool on) {
    controller_.set(fault, on);
    if (fault == RobotFault::cut_cable && !on)
      for (const auto& client : clients_) client->close();
    if (!on && options_.lockstep) tell_state();
  }

  void step() {
    controller_.step();
    tell_state();
    tell_modes();
  }

  std::string dashboard(const std::string& command) { return controller_.dashboard(command); }
  void set_at(RobotFault fault, double time_s) { controller_.set_at(fault, time_s); }
  void delay_scripts(std::vector<double> delays_s) { controller_.delay_scripts(std::move(delays_s)); }

  void hold_dashboard(bool on) {
    dashboard_held_ = on;
    for (const auto& [client, line] : std::exchange(held_questions_, {})) answer_dashboard(client, line);
  }

  VirtualTruth truth() const {
    VirtualTruth truth{controller_.state(),        {},
                       controller_.moving(),       controller_.rest_since_s(),
                       controller_.script_error(), controller_.waiting_scripts(),
                       held_questions_.size()};
    truth.base_from_tip = base_from_flange(options_.arm, truth.state.joints) * options_.tool.flange_from_tcp;
    return truth;
  }

  const VirtualUrOptions& options() const { return options_; }
  VirtualUrCounters counters() const {
    VirtualUrCounters counters = counters_;
    counters.clients = clients_.size();
    return counters;
  }

 private:
  template <class Handle>
  void accept(std::size_t port, Handle handle) {
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

  template <class Handle>
  void welcome(std::size_t port, tcp::socket socket, Handle handle) {
    ++counters_.connections;
    make_room(port);
    std::error_code ignored;
    socket.set_option(tcp::no_delay(true), ignored);
    auto client = std::make_shared<VirtualUrClient>(std::move(socket), port, [this](const std::string& line) {
      ++counters_.cut;
      note(line);
    });
    clients_.push_back(client);
    if (port == 1) client->send("Connected: Universal Robots Dashboard Server\n");
    if (port == 2) client->send(empty_robot_state);
    if (port == primary) client->send(version_message(controller_.version()));
    read(client, handle);
  }

  /// On a full port the oldest client that does not command is disconnected.
  void make_room(std::size_t port) {
    std::erase_if(clients_, [](const auto& one) { return !one->socket.is_open(); });
    if (std::ranges::count(clients_, port, &VirtualUrClient::port) < most_clients_of_port) return;
    const auto oldest = std::ranges::find_if(
        clients_, [port](const auto& one) { return one->port == port && !one->commands; });
    (*oldest)->cut("replaced by another client");
    clients_.erase(oldest);
  }

  void note(const std::string& line) {
    if (const auto left_out = lines_.pass())
      options_.on_notice(*left_out == 0 ? line : fmt::format("{} ({} lines omitted)", line, *left_out));
  }

  template <class Handle>
  void read(const std::shared_ptr<VirtualUrClient>& client, Handle handle) {
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
  void tick(std::chrono::steady_clock::time_point due) {
    timer_.expires_at(due);
    timer_.async_wait([this, due](const std::error_code& error) {
      if (error) return;
      step();
      const std::chrono::nanoseconds period(static_cast<long>(1e9 / options_.controller.rate_hz));
      tick(std::max(due + period, std::chrono::steady_clock::now() - 2 * period));
    });
  }

  void hear_dashboard(VirtualUrClient& client, std::string_view bytes) {
    client.text += bytes;
    for (std::size_t end = client.text.find('\n'); end != std::string::npos; end = client.text.find('\n')) {
      const std::string line = client.text.substr(0, end);
      client.text.erase(0, end + 1);
      answer_dashboard(client.shared_from_this(), line);
    }
    if (client.text.size() > 1000) client.cut("line over 1000 bytes");
  }

  void answer_dashboard(const std::shared_ptr<VirtualUrClient>& client, const std::string& line) {
    constexpr std::size_t most_held = 1000;
    if (dashboard_held_ && held_questions_.size() >= most_held)
      client->cut("over 1000 commands while the dashboard is held");
    else if (dashboard_held_)
      held_questions_.emplace_back(client, line);
    else if (client->socket.is_open())
      client->send(controller_.dashboard(line) + "\n");
  }

  void hear_script(VirtualUrClient& client, std::string_view bytes) {
    client.text += bytes;
    constexpr std::string_view last = "\nend\n";
    for (std::size_t end = client.text.find(last); end != std::string::npos; end = client.text.find(last)) {
      controller_.run_script(client.text.substr(0, end + last.size()));
      client.text.erase(0, end + last.size());
    }
    if (client.text.size() > 1 << 17) client.cut("script over 128 KiB");
  }

  void hear_rtde(VirtualUrClient& client, std::string_view bytes) {
    client.stream.append(bytes);
    for (;;) {
      const auto message = client.stream.next();
      if (!message) return client.close();
      if (!*message) return;
      if (!guarded([&] { answer(client, **message); })) return client.close();
    }
  }

  void answer(VirtualUrClient& client, const RtdeMessage& message) {
    BigEndianReader reader(message.content);
    const auto reply = [&](std::string content) {
      client.send(to_bytes({message.kind, std::move(content)}));
    };
    switch (message.kind) {
      case RtdeKind::version:
        return reply(reader.take<std::uint16_t>() == 2 && !controller_.has(RobotFault::wrong_version)
                         ? "\1"
                         : std::string(1, '\0'));
      case RtdeKind::controller_version: {
        BigEndianWriter version;
        for (const std::uint32_t part : controller_.version()) version.put(part);
        return reply(version.bytes());
      }
      case RtdeKind::outputs: {
        const double asked_hz = reader.take<double>(), most_hz = options_.controller.rate_hz;
        client.interval_s = 1 / (asked_hz > 0 ? std::min(asked_hz, most_hz) : most_hz);
        client.due_s = 0;
        return reply(outputs(client, reader.take(reader.left())));
      }
      case RtdeKind::inputs: {
        const bool taken = controller_.has(RobotFault::input_in_use) ||
                           std::ranges::any_of(clients_, [](const auto& one) { return one->commands; });
        const bool known = reader.take(reader.left()) == fmt::format("{}", fmt::join(heartbeat_names, ","));
        client.commands = known && !taken;
        const std::string type = !known ? "NOT_FOUND" : taken ? "IN_USE" : "INT32";
        return reply(fmt::format("{}{},{},{}", static_cast<char>(heartbeat_recipe), type, type, type));
      }
      case RtdeKind::start:
        client.started = !client.names.empty();
        reply(client.started ? "\1" : std::string(1, '\0'));
        if (options_.lockstep) tell_state();
        return;
      case RtdeKind::pause:
        client.started = false;
        return reply("\1");
      case RtdeKind::data:
        if (!client.commands || reader.take<std::uint8_t>() != heartbeat_recipe) return;
        controller_.set_heartbeat(take_heartbeat(reader));
        if (client.unanswered > 0) --client.unanswered;
        if (options_.lockstep && client.unanswered == 0) step();
        return;
      default:
        return;
    }
  }

  std::string outputs(VirtualUrClient& client, std::string_view wanted) {
    client.names.clear();
    std::string types(1, static_cast<char>(state_recipe));
    bool all_known = true;
    while (!wanted.empty()) {
      const std::string name(wanted.substr(0, wanted.find(',')));
      wanted.remove_prefix(std::min(wanted.size(), name.size() + 1));
      const auto found = std::ranges::find(state_names, name);
      const bool known = found != state_names.end() &&
                         !(name == "tcp_offset" && controller_.has(RobotFault::unknown_output));
      all_known = all_known && known;
      if (!client.names.empty()) types += ',';
      types += known ? state_types[static_cast<std::size_t>(found - state_names.begin())] : "NOT_FOUND";
      client.names.push_back(name);
    }
    if (!all_known) client.names.clear();
    return types;
  }

  void tell_state() {
    if (controller_.has(RobotFault::frozen_states) || controller_.has(RobotFault::cut_cable)) return;
    const RobotState state = controller_.state();
    for (const auto& client : clients_) {
      if (!client->started || !client->socket.is_open() ||
          !client->takes(controller_.time_s(), 1 / options_.controller.rate_hz))
        continue;
      std::string bytes = to_bytes(state_message(state_recipe, state, client->names));
      if (controller_.has(RobotFault::half_packet)) bytes.resize(bytes.size() / 2);
      if (controller_.has(RobotFault::huge_packet)) bytes = "\xff\xffU";
      client->send(bytes);
      ++client->unanswered;
    }
    // The rest of a truncated packet never arrives.
    if (controller_.has(RobotFault::half_packet)) controller_.set(RobotFault::frozen_states, true);
  }

  /// To the clients of the primary port.
  void tell_modes() {
    constexpr double interval_s = 0.1;
    const double now_s = controller_.time_s();
    if (now_s < modes_due_s_ && modes_due_s_ <= now_s + interval_s) return;
    modes_due_s_ = now_s + interval_s;
    if (controller_.has(RobotFault::cut_cable)) return;
    const std::string bytes = modes_message(controller_.state());
    for (const auto& client : clients_)
      if (client->port == primary) client->send(bytes);
  }

  VirtualUrOptions options_;
  VirtualController controller_;
  asio::io_context io_;
  std::array<tcp::acceptor, ports> acceptors_{tcp::acceptor(io_), tcp::acceptor(io_), tcp::acceptor(io_),
                                              tcp::acceptor(io_)};
  asio::steady_timer timer_{io_};
  std::array<asio::steady_timer, ports> retry_timers_{asio::steady_timer(io_), asio::steady_timer(io_),
                                                      asio::steady_timer(io_), asio::steady_timer(io_)};
  double modes_due_s_ = 0;
  std::list<std::shared_ptr<VirtualUrClient>> clients_;
  VirtualUrCounters counters_;
  LineLimit lines_{20};
  bool dashboard_held_ = false;
  std::vector<std::pair<std::shared_ptr<VirtualUrClient>, std::string>> held_questions_;
  std::thread thread_;
};

VirtualUr::VirtualUr(std::unique_ptr<Server> server) : server_(std::move(server)) {}
VirtualUr::~VirtualUr() = default;

Expected<std::unique_ptr<VirtualUr>> VirtualUr::start(const VirtualUrOptions& options) {
  auto server = std::make_unique<Server>(options);
  if (const auto listening = server->listen(); !listening) return tl::unexpected<Failure>(listening.error());
  return std::unique_ptr<VirtualUr>(new VirtualUr(std::move(server)));
}

std::uint16_t VirtualUr::rtde_port() const { return server_->port(0); }
std::uint16_t VirtualUr::dashboard_port() const { return server_->port(1); }
std::uint16_t VirtualUr::script_port() const { return server_->port(2); }
std::uint16_t VirtualUr::primary_port() const { return server_->port(primary); }

void VirtualUr::set(RobotFault fault, bool on) {
  server_->there([&] { server_->set(fault, on); });
}

void VirtualUr::set_at(RobotFault fault, double time_s) {
  server_->there([&] { server_->set_at(fault, time_s); });
}

std::string VirtualUr::dashboard(const std::string& command) {
  return server_->there([&] { return server_->dashboard(command); });
}

void VirtualUr::delay_scripts(std::vector<double> delays_s) {
  server_->there([&] { server_->delay_scripts(std::move(delays_s)); });
}

void VirtualUr::hold_dashboard(bool on) {
  server_->there([&] { server_->hold_dashboard(on); });
}

void VirtualUr::advance(double seconds) {
  server_->there([&] {
    const auto steps = static_cast<int>(std::ceil(seconds * server_->options().controller.rate_hz));
    for (int i = 0; i < steps; ++i) server_->step();
  });
}

VirtualUrCounters VirtualUr::counters() {
  return server_->there([&] { return server_->counters(); });
}

VirtualTruth VirtualUr::truth() {
  return server_->there([&] { return server_->truth(); });
}

}  // namespace helicarm::robot
