// SPDX-License-Identifier: Apache-2.0
// RTDE of the virtual robot.
#include <algorithm>

#include <fmt/format.h>

#include "helicarm/core/big_endian.h"
#include "helicarm/virtual_devices/robot/virtual_ur_server.h"

namespace helicarm::robot {
namespace {

constexpr std::uint8_t state_recipe = 1, heartbeat_recipe = 2;

Heartbeat take_heartbeat(BigEndianReader& reader) {
  Heartbeat heartbeat;
  for (std::int32_t* part : {&heartbeat.beat, &heartbeat.order.session, &heartbeat.order.count})
    *part = reader.take<std::int32_t>();
  return heartbeat;
}

}  // namespace

void VirtualUr::Server::hear_rtde(VirtualUrClient& client, std::string_view bytes) {
  client.stream.append(bytes);
  for (;;) {
    const auto message = client.stream.next();
    if (!message) return client.close();
    if (!*message) return;
    if (!guarded([&] { answer(client, **message); })) return client.close();
  }
}

void VirtualUr::Server::answer(VirtualUrClient& client, const RtdeMessage& message) {
  BigEndianReader reader(message.content);
  const auto reply = [&](std::string content) { client.send(to_bytes({message.kind, std::move(content)})); };
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
    case RtdeKind::inputs:
      return reply(take_inputs(client, reader.take(reader.left())));
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

/// Types of the requested inputs; only one client may write them.
std::string VirtualUr::Server::take_inputs(VirtualUrClient& client, std::string_view wanted) {
  const bool taken = controller_.has(RobotFault::input_in_use) ||
                     std::ranges::any_of(clients_, [](const auto& one) { return one->commands; });
  const bool known = wanted == fmt::format("{}", fmt::join(heartbeat_names, ","));
  client.commands = known && !taken;
  const std::string type = !known ? "NOT_FOUND" : taken ? "IN_USE" : "INT32";
  return fmt::format("{}{},{},{}", static_cast<char>(heartbeat_recipe), type, type, type);
}

std::string VirtualUr::Server::outputs(VirtualUrClient& client, std::string_view wanted) {
  client.names.clear();
  std::string types(1, static_cast<char>(state_recipe));
  bool all_known = true;
  while (!wanted.empty()) {
    const std::string name(wanted.substr(0, wanted.find(',')));
    wanted.remove_prefix(std::min(wanted.size(), name.size() + 1));
    const auto found = std::ranges::find(state_names, name);
    const bool known =
        found != state_names.end() && !(name == "tcp_offset" && controller_.has(RobotFault::unknown_output));
    all_known = all_known && known;
    if (!client.names.empty()) types += ',';
    types += known ? state_types[static_cast<std::size_t>(found - state_names.begin())] : "NOT_FOUND";
    client.names.push_back(name);
  }
  if (!all_known) client.names.clear();
  return types;
}

void VirtualUr::Server::tell_state() {
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

}  // namespace helicarm::robot
