// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/rtde_message.h"

#include <limits>

#include <gmock/gmock.h>

#include "helicarm/core/big_endian.h"

namespace helicarm::robot {
namespace {

using namespace std::string_literals;

RobotState some_state() {
  RobotState state;
  state.time_s = 12.5;
  state.joints << 0.1, -1.2, 1.3, -1.4, -1.5, 1.6;
  state.joint_speeds << 0, 0.25, 0, 0, -0.5, 0;
  state.base_from_tcp = transform_from((UrPose() << 0.3, -0.2, 0.4, 0.1, 3, 0.2).finished());
  state.flange_from_tcp.translation = {0, 0, 150};
  state.payload_kg = 1.2;
  state.safety_mode = SafetyMode::reduced;
  state.runtime = RuntimeState::playing;
  state.speed_scaling = 0.5;
  state.script = {ScriptStage::begun, {301, 302}, 303};
  return state;
}

Expected<std::optional<RtdeMessage>> first_of(const std::string& bytes) {
  RtdeStream stream;
  stream.append(bytes);
  return stream.next();
}

TEST(RtdeMessage, RequestsMatchTheGuidesBytes) {
  EXPECT_EQ(request_version(), "\x00\x05\x56\x00\x02"s);
  EXPECT_EQ(request_controller_version(), "\x00\x03\x76"s);
  EXPECT_EQ(request_start(), "\x00\x03\x53"s);
  EXPECT_EQ(request_inputs(),
            "\x00\x44\x49input_int_register_24,input_int_register_25,input_int_register_26"s);
  EXPECT_THAT(request_outputs(125),
              testing::StartsWith("\x00\xe8\x4f\x40\x5f\x40\x00\x00\x00\x00\x00timestamp,actual_q,"s));
  EXPECT_EQ(heartbeat_message(1, {258, {3, 4}}),
            "\x00\x10\x55\x01\x00\x00\x01\x02\x00\x00\x00\x03\x00\x00\x00\x04"s);
}

TEST(RtdeMessage, GrantIsRead) {
  EXPECT_TRUE(*read_granted(**first_of("\x00\x04\x56\x01"s), RtdeKind::version));
  EXPECT_FALSE(*read_granted(**first_of("\x00\x04\x53\x00"s), RtdeKind::start));
  EXPECT_EQ(read_granted({RtdeKind::start, "\1\1"}, RtdeKind::start).error().reason, Reason::bad_size);
  EXPECT_EQ(read_granted({RtdeKind::pause, "\1"}, RtdeKind::start).error().reason, Reason::bad_value);
  EXPECT_EQ(read_granted({RtdeKind::start, ""}, RtdeKind::start).error().reason, Reason::truncated);
}

TEST(RtdeMessage, StreamCutAnywhereGivesTheSameMessages) {
  const std::string bytes = request_version() + to_bytes(state_message(1, some_state())) + request_start();
  for (std::size_t cut = 0; cut <= bytes.size(); ++cut) {
    RtdeStream stream;
    std::string kinds;
    for (const auto& part : {bytes.substr(0, cut), bytes.substr(cut)}) {
      stream.append(part);
      for (auto message = *stream.next(); message; message = *stream.next())
        kinds += static_cast<char>(message->kind);
    }
    EXPECT_EQ(kinds, "VUS") << cut;
  }
}

TEST(RtdeMessage, InvalidSizeIsRefused) {
  for (const std::string& bytes : {"\0\0U"s, "\0\2U"s, "\xff\xffU"s})
    EXPECT_EQ(first_of(bytes).error().reason, Reason::bad_size);
}

TEST(RtdeMessage, StateRoundTrips) {
  const RobotState given = some_state();
  const auto read = read_state(state_message(7, given), 7);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->joints, given.joints);
  EXPECT_EQ(read->joint_speeds, given.joint_speeds);
  EXPECT_TRUE(read->base_from_tcp.matrix().isApprox(given.base_from_tcp.matrix(), 1e-12));
  EXPECT_TRUE(read->flange_from_tcp.matrix().isApprox(given.flange_from_tcp.matrix(), 1e-12));
  EXPECT_EQ(read->safety_mode, SafetyMode::reduced);
  EXPECT_EQ(read->script.stage, ScriptStage::begun);
  EXPECT_EQ(read->script.order, (OrderNumber{301, 302}));
  EXPECT_EQ(read->script.tick, 303);
  EXPECT_EQ(read->time_s, 12.5);
}

TEST(RtdeMessage, StateOfAnyOtherLengthOrRecipeIsRefused) {
  const RtdeMessage whole = state_message(7, some_state());
  for (std::size_t size = 0; size < whole.content.size(); ++size)
    EXPECT_EQ(read_state({RtdeKind::data, whole.content.substr(0, size)}, 7).error().reason,
              Reason::truncated);
  EXPECT_EQ(read_state({RtdeKind::data, whole.content + "x"}, 7).error().reason, Reason::bad_size);
  EXPECT_EQ(read_state(whole, 8).error().reason, Reason::bad_value);
  RobotState state = some_state();
  state.joints[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(read_state(state_message(7, state), 7).error().reason, Reason::not_finite);
}

TEST(RtdeMessage, StateWhosePoseOverflowsIsNotFinite) {
  constexpr std::size_t pose_at = 1 + 8 + 6 * 8 + 6 * 8, turn_at = pose_at + 24;
  for (const std::size_t at : {pose_at, turn_at}) {
    RtdeMessage message = state_message(7, some_state());
    message.content.replace(at, 8, BigEndianWriter().put(1e307).bytes());
    EXPECT_EQ(read_state(message, 7).has_value(), false) << at;
  }
}

TEST(RtdeMessage, RecipeNamesWhatIsMissing) {
  const auto reply = [](const std::string& types) { return RtdeMessage{RtdeKind::inputs, "\2" + types}; };
  const auto read = [&](const std::string& types) {
    return read_recipe(reply(types), {heartbeat_names[0]}, {heartbeat_types[0]});
  };
  EXPECT_EQ(*read("INT32"), 2);
  EXPECT_EQ(read("IN_USE").error().reason, Reason::robot_locked);
  EXPECT_EQ(read("NOT_FOUND").error().reason, Reason::unsupported);
  EXPECT_EQ(read("DOUBLE").error().reason, Reason::unsupported);
  EXPECT_EQ(read("INT32,INT32").error().reason, Reason::bad_size);
  EXPECT_THAT(read("NOT_FOUND").error().message, testing::HasSubstr(heartbeat_names[0]));
}

TEST(RtdeMessage, RobotTextHasNoControlCharacters) {
  EXPECT_EQ(*read_text({RtdeKind::text, "\5\x1b[2Jx\0\1"s}), "?[2Jx");
  EXPECT_EQ(read_text({RtdeKind::text, "\x09 abc"s}).error().reason, Reason::truncated);
}

TEST(RobotState, UnknownModeHasANameToo) {
  for (const std::int32_t mode :
       {std::numeric_limits<std::int32_t>::min(), -2, 99, std::numeric_limits<std::int32_t>::max()}) {
    EXPECT_EQ(name(static_cast<RobotMode>(mode)), "UNKNOWN");
    EXPECT_EQ(name(static_cast<SafetyMode>(mode)), "UNKNOWN");
  }
}

TEST(RobotState, EveryStopIsReported) {
  RobotState state;
  EXPECT_FALSE(why_stopped(state));
  for (int mode = 3; mode <= 20; ++mode) {
    state.safety_mode = static_cast<SafetyMode>(mode);
    EXPECT_EQ(why_stopped(state)->reason, Reason::robot_stopped) << mode;
  }
  state = {};
  for (int mode = -1; mode <= 12; ++mode) {
    state.robot_mode = static_cast<RobotMode>(mode);
    EXPECT_EQ(why_stopped(state).has_value(), mode != 7) << mode;
  }
  state = {};
  state.safety_bits |= 1u << 6;
  EXPECT_TRUE(why_stopped(state));
  state = {};
  state.speed_scaling = 0;
  EXPECT_TRUE(why_stopped(state));
}

}  // namespace
}  // namespace helicarm::robot
