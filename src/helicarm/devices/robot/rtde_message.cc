// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/rtde_message.h"

#include <array>

#include <fmt/format.h>

#include "helicarm/core/big_endian.h"
#include "helicarm/core/text.h"

namespace helicarm::robot {
namespace {

constexpr std::size_t header_size = 3;
constexpr std::size_t largest_message = 4096;

std::string joined(const std::vector<std::string>& words) { return fmt::format("{}", fmt::join(words, ",")); }

std::vector<std::string> split(std::string_view text) {
  std::vector<std::string> words(1);
  for (const char c : text)
    if (c == ',')
      words.emplace_back();
    else
      words.back() += c;
  return words;
}

void expect_kind(const RtdeMessage& message, RtdeKind kind) {
  if (message.kind != kind)
    throw BadInput(Reason::bad_value, fmt::format("RTDE: message of kind {}, expected {}",
                                                  static_cast<int>(message.kind), static_cast<int>(kind)));
}

void expect_end(const BigEndianReader& reader) {
  if (reader.left() != 0)
    throw BadInput(Reason::bad_size, fmt::format("RTDE: message is {} bytes too long", reader.left()));
}

Eigen::Matrix<double, 6, 1> take_six(BigEndianReader& reader) {
  Eigen::Matrix<double, 6, 1> six;
  for (double& value : six) value = reader.take<double>();
  return six;
}

template <class T>
std::string packed(T value) {
  return BigEndianWriter().put(value).bytes();
}

std::string packed(const Eigen::Matrix<double, 6, 1>& six) {
  BigEndianWriter writer;
  for (const double value : six) writer.put(value);
  return writer.bytes();
}

}  // namespace

const std::vector<std::string> state_names = {"timestamp",
                                              "actual_q",
                                              "actual_qd",
                                              "actual_TCP_pose",
                                              "tcp_offset",
                                              "payload",
                                              "robot_mode",
                                              "safety_mode",
                                              "safety_status_bits",
                                              "runtime_state",
                                              "speed_scaling",
                                              "output_int_register_0",
                                              "output_int_register_1",
                                              "output_int_register_2",
                                              "output_int_register_3"};
const std::vector<std::string> state_types = {"DOUBLE", "VECTOR6D", "VECTOR6D", "VECTOR6D", "VECTOR6D",
                                              "DOUBLE", "INT32",    "INT32",    "UINT32",   "UINT32",
                                              "DOUBLE", "INT32",    "INT32",    "INT32",    "INT32"};
// 24 to 47 are reserved for RTDE clients.
const std::vector<std::string> heartbeat_names = {"input_int_register_24", "input_int_register_25",
                                                  "input_int_register_26"};
const std::vector<std::string> heartbeat_types = {"INT32", "INT32", "INT32"};

std::string to_bytes(const RtdeMessage& message) {
  return BigEndianWriter()
      .put(static_cast<std::uint16_t>(header_size + message.content.size()))
      .put(static_cast<std::uint8_t>(message.kind))
      .put(message.content)
      .bytes();
}

Expected<std::optional<RtdeMessage>> RtdeStream::next() {
  if (bytes_.size() < header_size) return std::nullopt;
  BigEndianReader reader(bytes_);
  const std::size_t size = reader.take<std::uint16_t>();
  if (size < header_size || size > largest_message)
    return fail(Reason::bad_size, fmt::format("RTDE: a message has {} bytes, must have {} to {}", size,
                                              header_size, largest_message));
  if (bytes_.size() < size) return std::nullopt;
  const auto kind = static_cast<RtdeKind>(reader.take<std::uint8_t>());
  RtdeMessage message{kind, std::string(reader.take(size - header_size))};
  bytes_.erase(0, size);
  return message;
}

std::string request_version() { return to_bytes({RtdeKind::version, std::string("\0\2", 2)}); }
std::string request_controller_version() { return to_bytes({RtdeKind::controller_version, {}}); }
std::string request_outputs(double rate_hz) {
  return to_bytes({RtdeKind::outputs, BigEndianWriter().put(rate_hz).put(joined(state_names)).bytes()});
}
std::string request_inputs() { return to_bytes({RtdeKind::inputs, joined(heartbeat_names)}); }
std::string request_start() { return to_bytes({RtdeKind::start, {}}); }
std::string heartbeat_message(std::uint8_t recipe, const Heartbeat& heartbeat) {
  return to_bytes({RtdeKind::data, BigEndianWriter()
                                       .put(recipe)
                                       .put(heartbeat.beat)
                                       .put(heartbeat.order.session)
                                       .put(heartbeat.order.count)
                                       .bytes()});
}

Expected<std::uint8_t> read_recipe(const RtdeMessage& reply, const std::vector<std::string>& names,
                                   const std::vector<std::string>& types) {
  return guarded([&] {
    if (reply.kind != RtdeKind::outputs) expect_kind(reply, RtdeKind::inputs);
    BigEndianReader reader(reply.content);
    const auto recipe = reader.take<std::uint8_t>();
    const std::vector<std::string> received_types = split(reader.take(reader.left()));
    if (received_types.size() != types.size())
      throw BadInput(Reason::bad_size,
                     fmt::format("RTDE: {} types for {} names", received_types.size(), types.size()));
    for (std::size_t i = 0; i < types.size(); ++i) {
      if (received_types[i] == "IN_USE")
        throw BadInput(Reason::robot_locked,
                       names[i] + " is in use by another program: disconnect it from the robot");
      if (received_types[i] == "NOT_FOUND")
        throw BadInput(Reason::unsupported, "the controller does not support " + names[i]);
      if (received_types[i] != types[i])
        throw BadInput(Reason::unsupported,
                       fmt::format("{} has type {}, must be {}", names[i],
                                   without_control_characters(received_types[i]), types[i]));
    }
    return recipe;
  });
}

Expected<bool> read_granted(const RtdeMessage& reply, RtdeKind kind) {
  return guarded([&] {
    expect_kind(reply, kind);
    BigEndianReader reader(reply.content);
    const bool granted = reader.take<std::uint8_t>() != 0;
    expect_end(reader);
    return granted;
  });
}

Expected<ControllerVersion> read_controller_version(const RtdeMessage& reply) {
  return guarded([&] {
    expect_kind(reply, RtdeKind::controller_version);
    BigEndianReader reader(reply.content);
    ControllerVersion version;
    for (auto* part : {&version.major, &version.minor, &version.bugfix, &version.build})
      *part = reader.take<std::uint32_t>();
    expect_end(reader);
    return version;
  });
}

Expected<std::string> read_text(const RtdeMessage& message) {
  return guarded([&] {
    expect_kind(message, RtdeKind::text);
    BigEndianReader reader(message.content);
    const std::string text(reader.take(reader.take<std::uint8_t>()));
    return without_control_characters(text);
  });
}

Expected<RobotState> read_state(const RtdeMessage& message, std::uint8_t recipe) {
  return guarded([&] {
    expect_kind(message, RtdeKind::data);
    BigEndianReader reader(message.content);
    if (reader.take<std::uint8_t>() != recipe)
      throw BadInput(Reason::bad_value, "RTDE: data of an unknown recipe");
    RobotState state;
    state.time_s = reader.take<double>();
    state.joints = take_six(reader);
    state.joint_speeds = take_six(reader);
    const UrPose tcp = take_six(reader), offset = take_six(reader);
    state.payload_kg = reader.take<double>();
    state.robot_mode = static_cast<RobotMode>(reader.take<std::int32_t>());
    state.safety_mode = static_cast<SafetyMode>(reader.take<std::int32_t>());
    state.safety_bits = reader.take<std::uint32_t>();
    state.runtime = static_cast<RuntimeState>(reader.take<std::uint32_t>());
    state.speed_scaling = reader.take<double>();
    state.script.stage = static_cast<ScriptStage>(reader.take<std::int32_t>());
    state.script.order.session = reader.take<std::int32_t>();
    state.script.order.count = reader.take<std::int32_t>();
    state.script.tick = reader.take<std::int32_t>();
    expect_end(reader);
    state.base_from_tcp = transform_from(tcp);
    state.flange_from_tcp = transform_from(offset);
    // Finite metres can overflow in millimetres, and a rotation vector in its norm.
    const bool finite = std::isfinite(state.time_s) && state.joints.allFinite() &&
                        state.joint_speeds.allFinite() && state.base_from_tcp.matrix().allFinite() &&
                        state.flange_from_tcp.matrix().allFinite() && std::isfinite(state.payload_kg) &&
                        std::isfinite(state.speed_scaling);
    if (!finite) throw BadInput(Reason::not_finite, "RTDE: a number of the state is not finite");
    return state;
  });
}

RtdeMessage state_message(std::uint8_t recipe, const RobotState& state,
                          const std::vector<std::string>& names) {
  const std::array<std::string, 15> fields = {packed(state.time_s),
                                              packed(state.joints),
                                              packed(state.joint_speeds),
                                              packed(ur_pose(state.base_from_tcp)),
                                              packed(ur_pose(state.flange_from_tcp)),
                                              packed(state.payload_kg),
                                              packed(static_cast<std::int32_t>(state.robot_mode)),
                                              packed(static_cast<std::int32_t>(state.safety_mode)),
                                              packed(state.safety_bits),
                                              packed(static_cast<std::uint32_t>(state.runtime)),
                                              packed(state.speed_scaling),
                                              packed(static_cast<std::int32_t>(state.script.stage)),
                                              packed(state.script.order.session),
                                              packed(state.script.order.count),
                                              packed(state.script.tick)};
  std::string content(1, static_cast<char>(recipe));
  for (const std::string& name : names)
    for (std::size_t i = 0; i < fields.size(); ++i)
      if (state_names[i] == name) content += fields[i];
  return {RtdeKind::data, content};
}

}  // namespace helicarm::robot
