// SPDX-License-Identifier: Apache-2.0
#include <fmt/ranges.h>

#include "helicarm/devices/robot/rtde_message.h"
#include "target.h"

namespace helicarm::fuzz {
namespace {

constexpr std::uint8_t recipe = 1;

void run_message(const robot::RtdeMessage& message) {
  if (const auto text = read_text(message)) check(text->size() <= 255, "a text has at most 255 bytes");
  (void)read_granted(message, message.kind);
  (void)read_controller_version(message);
  (void)read_recipe(message, robot::state_names, robot::state_types);
  const auto state = read_state(message, recipe);
  if (!state) return;
  check(state->joints.allFinite() && state->joint_speeds.allFinite(), "joints are finite");
  check(state->base_from_tcp.matrix().allFinite() && state->flange_from_tcp.matrix().allFinite(),
        "poses are finite");
  check((state->base_from_tcp.rotation.transpose() * state->base_from_tcp.rotation).isIdentity(1e-6),
        "poses are rigid");
  (void)robot::why_stopped(*state);
  (void)to_json(*state).dump();
  const auto again = read_state(state_message(recipe, *state), recipe);
  check(again.has_value() && again->joints == state->joints && again->safety_mode == state->safety_mode,
        "a state is written unchanged");
}

}  // namespace

void run(std::string_view bytes) {
  const std::size_t segment = 1 + Choices(bytes).byte();
  robot::RtdeStream stream;
  while (!bytes.empty()) {
    stream.append(bytes.substr(0, segment));
    bytes.remove_prefix(std::min(segment, bytes.size()));
    for (;;) {
      const auto message = stream.next();
      if (!message) return;
      if (!*message) break;
      check((*message)->content.size() <= 4096, "a message has at most 4096 bytes");
      run_message(**message);
    }
  }
}

std::vector<std::string> seeds() {
  robot::RobotState state;
  state.time_s = 12.5;
  state.joints << 0.1, -1.2, 1.3, -0.4, 0.5, 0.6;
  state.base_from_tcp.translation = {400, -100, 300};
  const std::string data = to_bytes(state_message(recipe, state));
  const std::string types = fmt::format("{}", fmt::join(robot::state_types, ","));
  const std::string version("\0\0\0\5\0\0\0\x19\0\0\0\1\0\0\0\0", 16);
  const std::vector<robot::RtdeMessage> others = {{robot::RtdeKind::outputs, '\1' + types},
                                                  {robot::RtdeKind::inputs, std::string("\1IN_USE")},
                                                  {robot::RtdeKind::inputs, "\1INT32"},
                                                  {robot::RtdeKind::outputs, "\1NOT_FOUND"},
                                                  {robot::RtdeKind::version, "\1"},
                                                  {robot::RtdeKind::start, "\1"},
                                                  {robot::RtdeKind::controller_version, version},
                                                  {robot::RtdeKind::text, "\5hello\2me\1"}};
  std::vector<std::string> all{'\xff' + data, '\x10' + data + data};
  std::string handshake(1, '\x20');
  for (const robot::RtdeMessage& message : others) {
    all.push_back('\xff' + to_bytes(message));
    handshake += to_bytes(message);
  }
  all.push_back(handshake + data);
  return all;
}

}  // namespace helicarm::fuzz
