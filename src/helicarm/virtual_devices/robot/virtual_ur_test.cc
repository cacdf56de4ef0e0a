// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/robot/virtual_ur.h"

#include <gmock/gmock.h>

#include "helicarm/core/big_endian.h"
#include "helicarm/devices/robot/dashboard.h"
#include "helicarm/devices/robot/robot_scene_test.h"
#include "helicarm/devices/robot/rtde_message.h"
#include "helicarm/devices/robot/script.h"
#include "helicarm/devices/robot/timed_socket.h"

namespace helicarm::robot {
namespace {

using namespace std::chrono_literals;
using namespace std::string_literals;

std::unique_ptr<VirtualUr> robot_on_any_port() {
  VirtualUrOptions options;
  options.tool = drill();
  options.joints = resting_joints();
  options.rtde_port = options.dashboard_port = options.script_port = 0;
  options.lockstep = true;
  return VirtualUr::start(options).value();
}

/// An RTDE client that works byte by byte.
struct RawClient {
  TimedSocket socket;
  RtdeStream stream = {};

  explicit RawClient(const VirtualUr& robot)
      : socket(TimedSocket::connect("127.0.0.1", robot.rtde_port(), 10s).value()) {}
  RtdeMessage next() {
    for (int i = 0; i < 1000; ++i) {
      if (auto message = stream.next().value()) return *message;
      stream.append(socket.receive(10ms).value());
    }
    throw std::runtime_error("no message");
  }
  RtdeMessage ask(const std::string& bytes) {
    EXPECT_TRUE(socket.send(bytes, 10s));
    return next();
  }
  void start() {
    EXPECT_EQ(ask("\x00\x05\x56\x00\x02"s).content, "\1");
    EXPECT_EQ(ask("\x00\x03\x76"s).content.substr(0, 8), "\0\0\0\3\0\0\0\17"s);
    EXPECT_EQ(
        ask(request_outputs(125)).content,
        "\1DOUBLE,VECTOR6D,VECTOR6D,VECTOR6D,VECTOR6D,DOUBLE,INT32,INT32,UINT32,UINT32,DOUBLE,INT32,INT32,"
        "INT32,INT32");
    EXPECT_EQ(ask(request_inputs()).content, "\2INT32,INT32,INT32");
    EXPECT_EQ(ask("\x00\x03\x53"s).content, "\1");
  }
};

TEST(VirtualUr, KilledProcessLeavesARobotThatStops) {
  const auto robot = robot_on_any_port();
  double alive_s = 0;
  {
    RawClient client(*robot);
    client.start();
    auto script = TimedSocket::connect("127.0.0.1", robot->script_port(), 10s).value();
    ASSERT_TRUE(script.send(script_of(planned(), ur5(), {7, 1}), 10s));
    while (robot->truth().state.joint_speeds.norm() < 0.05) {
      const RobotState state = read_state(client.next(), 1).value();
      ASSERT_LT(state.time_s, 40);
      const std::int32_t beat = state.script.tick > 0 ? state.script.tick : stop_beat;
      ASSERT_TRUE(client.socket.send(heartbeat_message(2, {beat, {7, 1}}), 10s));
    }
    ASSERT_TRUE(robot->truth().moving);
    alive_s = robot->truth().state.time_s;
  }
  robot->advance(0.5);
  EXPECT_FALSE(robot->truth().moving);
  EXPECT_LE(*robot->truth().rest_since_s - alive_s, 0.2);
  EXPECT_EQ(robot->truth().state.script.stage, ScriptStage::stopped);
}

TEST(VirtualUr, InvalidDataClosesTheConnectionAndMovesNothing) {
  const auto robot = robot_on_any_port();
  for (const std::string& bytes :
       {"\0\0\0"s, "\xff\xff\xff\xff"s, "\0\3\x56"s, "\0\4\x4f\1"s, "GET / HTTP/1.1\r\n"s}) {
    RawClient client(*robot);
    ASSERT_TRUE(client.socket.send(bytes, 10s));
    Expected<std::string> heard = "";
    for (int i = 0; i < 1000 && heard; ++i) heard = client.socket.receive(10ms);
    EXPECT_FALSE(heard) << bytes;
  }
  EXPECT_FALSE(robot->truth().moving);
}

TEST(VirtualUr, RequestedFieldsAreInOrderAndUnknownOnesAreNotFound) {
  const auto robot = robot_on_any_port();
  RawClient client(*robot);
  const std::string hz(8, '\0');
  EXPECT_EQ(client.ask(to_bytes({RtdeKind::outputs, hz + "timestamp,wish"})).content, "\1DOUBLE,NOT_FOUND");
  EXPECT_EQ(client.ask(request_start()).content, "\0"s);
  EXPECT_EQ(client.ask(to_bytes({RtdeKind::outputs, hz + "robot_mode,timestamp"})).content, "\1INT32,DOUBLE");
  EXPECT_EQ(client.ask(request_start()).content, "\1");
  EXPECT_EQ(client.next().content, "\1\0\0\0\7"s + std::string(8, '\0'));
  EXPECT_EQ(client.ask(to_bytes({RtdeKind::inputs, "wish"})).content, "\2NOT_FOUND,NOT_FOUND,NOT_FOUND");
}

TEST(VirtualUr, StatesComeAtTheRequestedRate) {
  const auto robot = robot_on_any_port();
  RawClient client(*robot);
  const std::string rate = BigEndianWriter().put(25.0).bytes();
  robot->advance(2);
  EXPECT_EQ(client.ask(to_bytes({RtdeKind::outputs, rate + "timestamp"})).content, "\1DOUBLE");
  EXPECT_EQ(client.ask(request_start()).content, "\1");
  robot->advance(1);
  std::vector<double> times;
  do {
    const RtdeMessage message = client.next();
    times.push_back(BigEndianReader(std::string_view(message.content).substr(1)).take<double>());
  } while (times.back() < 2.95);
  EXPECT_NEAR(double(times.size()), 25, 1);
  for (std::size_t i = 1; i < times.size(); ++i) EXPECT_NEAR(times[i] - times[i - 1], 0.04, 1e-6);
}

TEST(VirtualUr, PrimaryPortReportsTheVersionOfTheOtherPortsAndModes) {
  const auto robot = robot_on_any_port();
  auto socket = TimedSocket::connect("127.0.0.1", robot->primary_port(), 10s).value();
  std::string heard;
  const auto receive = [&](std::size_t size) {
    for (int i = 0; i < 1000 && heard.size() < size; ++i) heard += socket.receive(10ms).value();
  };
  constexpr std::size_t version_bytes = 5 + 8 + 2 + 10 + 2 + 8 + 7, modes_bytes = 5 + 47;
  receive(version_bytes);
  BigEndianReader version(heard);
  EXPECT_EQ(version.take<std::uint32_t>(), version_bytes);
  EXPECT_EQ(version.take<std::uint8_t>(), 20);
  version.take(8 + 2 + 10);
  EXPECT_EQ(version.take<std::uint8_t>(), 3);
  EXPECT_EQ(version.take<std::uint8_t>(), 15);
  EXPECT_EQ(robot->dashboard("PolyscopeVersion"), "URSoftware 3.15.8.0 (virtual)");
  robot->advance(0.2);
  receive(version_bytes + modes_bytes);
  BigEndianReader modes(std::string_view(heard).substr(version_bytes));
  EXPECT_EQ(modes.take<std::uint32_t>(), modes_bytes);
  EXPECT_EQ(modes.take<std::uint8_t>(), 16);
  EXPECT_EQ(modes.take<std::uint32_t>(), 47u);
  modes.take(1 + 8 + 7);
  EXPECT_EQ(modes.take<std::uint8_t>(), static_cast<std::uint8_t>(RobotMode::running));
}

TEST(VirtualUr, PortInUseIsReported) {
  const auto robot = robot_on_any_port();
  VirtualUrOptions options;
  options.rtde_port = robot->rtde_port();
  options.dashboard_port = options.script_port = 0;
  const auto second = VirtualUr::start(options);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().reason, Reason::port_taken);
  EXPECT_THAT(second.error().message, testing::HasSubstr(std::to_string(robot->rtde_port())));
  options.rtde_port = 0;
  options.address = "operating room";
  EXPECT_EQ(VirtualUr::start(options).error().reason, Reason::bad_value);
}

TEST(VirtualUr, ClockFollowsWallTimeUnlessInLockstep) {
  VirtualUrOptions options;
  options.rtde_port = options.dashboard_port = options.script_port = 0;
  options.controller = options.arm = ur5e();
  const auto robot = VirtualUr::start(options).value();
  for (int i = 0; i < 10000 && robot->truth().state.time_s < 0.05; ++i) std::this_thread::sleep_for(1ms);
  EXPECT_GE(robot->truth().state.time_s, 0.05);
}

TEST(Dashboard, AnswersAreMatchedWithTheirCommands) {
  const auto robot = robot_on_any_port();
  const auto ask = [&](DashboardCommand command) {
    return ask_dashboard("127.0.0.1", robot->dashboard_port(), command, 10s);
  };
  EXPECT_EQ(*ask(DashboardCommand::robot_mode), "Robotmode: RUNNING");
  EXPECT_EQ(*ask(DashboardCommand::safety_mode), "Safetymode: NORMAL");
  EXPECT_EQ(*ask(DashboardCommand::program_state), "STOPPED helicarm");
  EXPECT_EQ(*ask(DashboardCommand::remote_control), "true");
  EXPECT_EQ(*ask(DashboardCommand::stop), "Stopped");
  robot->set(RobotFault::protective_stop);
  EXPECT_EQ(ask(DashboardCommand::unlock_protective_stop).error().reason, Reason::bad_value);
  robot->advance(5.1);
  EXPECT_EQ(*ask(DashboardCommand::unlock_protective_stop), "Protective stop releasing");
  EXPECT_EQ(ask_dashboard("127.0.0.1", robot->rtde_port(), DashboardCommand::stop, 100ms).error().reason,
            Reason::not_connected);
  EXPECT_EQ(ask_dashboard("robot", 1, DashboardCommand::stop).error().reason, Reason::bad_value);
}

}  // namespace
}  // namespace helicarm::robot
