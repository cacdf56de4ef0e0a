// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/ndi_client.h"

#include <gmock/gmock.h>

#include "helicarm/core/files.h"
#include "helicarm/core/temporary_folder.h"
#include "helicarm/devices/tracker/igtl_peers_test.h"
#include "helicarm/devices/tracker/ndi_device.h"
#include "helicarm/devices/tracker/ndi_server.h"
#include "helicarm/devices/tracker/tracker_registry.h"

namespace helicarm::tracker {
namespace ndi_client_test {

IgtlMessage measured(int number, const std::vector<std::string>& tools) {
  IgtlTracking tracking;
  for (const std::string& name : tools) {
    Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
    pose(0, 3) = 10 + 0.01 * (number % 7);
    tracking.tools.push_back({name, 2, pose});
  }
  return {"", 0, tracking};
}

/// Sends measurements of these tools until it is destroyed.
std::jthread player(NdiServer& server, std::vector<std::string> tools) {
  return std::jthread([&server, tools = std::move(tools)](const std::stop_token& stop) {
    for (int i = 0; !stop.stop_requested(); ++i) {
      server.send(measured(i, tools));
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  });
}

ToolState state_of(const PoseBoard& board, const std::string& name) {
  for (const ToolState& tool : board.tools(monotonic_seconds()))
    if (tool.name == name) return tool;
  return {};
}

bool accepts(const PoseBoard& board, const std::string& name) {
  return eventually([&] { return state_of(board, name).accepted >= 3; });
}

std::unique_ptr<TrackerSource> a_tracker(std::uint16_t port, PoseBoard& board,
                                         std::map<std::string, std::filesystem::path> definitions = {}) {
  return value_or_throw(open_tracker(
      {.address = "ndi:127.0.0.1", .port = port, .rate_hz = 100, .definitions = std::move(definitions)},
      onto(board)));
}

TEST(NdiClient, ToolsOnCablesAreFollowedByTheirNames) {
  const auto server = NdiServer::start({.on_cables = {"femur", "tool"}}).value();
  const std::jthread playing = player(*server, {"femur", "tool"});
  PoseBoard board;
  const auto tracker = a_tracker(server->port(), board);
  EXPECT_TRUE(accepts(board, "femur"));
  EXPECT_TRUE(accepts(board, "tool"));
  EXPECT_EQ(tracker->status().state, LinkState::connected);
  tracker->stop();
  const auto until_then = state_of(board, "tool").accepted;
  EXPECT_EQ(state_of(board, "tool").accepted, until_then);
}

TEST(NdiClient, DefinitionIsLoadedAndNamesItsTool) {
  const TemporaryFolder folder;
  const auto file = folder.path() / "tool.rom";
  ASSERT_TRUE(write_file(file, "drill"));
  const auto server = NdiServer::start({}).value();
  const std::jthread playing = player(*server, {"drill"});
  PoseBoard board;
  const auto tracker = a_tracker(server->port(), board, {{"guide", file}});
  EXPECT_TRUE(accepts(board, "guide"));
  EXPECT_EQ(state_of(board, "drill").accepted, 0u);
}

TEST(NdiClient, MissingToolIsHidden) {
  const auto server = NdiServer::start({.on_cables = {"femur", "tibia"}}).value();
  const std::jthread playing = player(*server, {"femur"});
  PoseBoard board;
  const auto tracker = a_tracker(server->port(), board);
  EXPECT_TRUE(eventually([&] { return count_of(state_of(board, "tibia").rejected, "hidden") >= 3; }));
  EXPECT_EQ(state_of(board, "tibia").accepted, 0u);
}

TEST(NdiClient, MatrixThatIsNoRigidMotionIsMissing) {
  NdiDevice device({"femur"});
  for (const char* command : {"INIT ", "PINIT 01", "PENA 01D", "TSTART "})
    ASSERT_EQ(ndi_text(device.answer(std::string(command) + "\r")).value(), "OKAY") << command;
  IgtlTracking scaled{{{"femur", 2, 1.01 * Eigen::Matrix4d::Identity()}}};
  device.measure(scaled);
  EXPECT_EQ(ndi_tracking(device.answer("BX 0001\r")).value().tools.at(0).state, NdiToolState::missing);
}

TEST(NdiClient, MeasurementThatWasReceivedBeforeIsNotPassedOnAgain) {
  const auto server = NdiServer::start({.on_cables = {"femur"}}).value();
  PoseBoard board;
  const auto tracker = a_tracker(server->port(), board);
  ASSERT_TRUE(eventually([&] { return count_of(tracker->status().counters, "connections") == 1; }));
  server->send(measured(0, {"femur"}));
  ASSERT_TRUE(eventually([&] { return state_of(board, "femur").accepted == 1; }));
  ASSERT_TRUE(eventually([&] { return count_of(tracker->status().counters, "repeated") >= 10; }));
  EXPECT_EQ(state_of(board, "femur").accepted, 1u);
}

TEST(NdiClient, RestartedDeviceIsFoundAgain) {
  auto server = NdiServer::start({.on_cables = {"femur"}}).value();
  const std::uint16_t port = server->port();
  PoseBoard board;
  const auto tracker = a_tracker(port, board);
  {
    const std::jthread playing = player(*server, {"femur"});
    ASSERT_TRUE(accepts(board, "femur"));
  }
  server.reset();
  ASSERT_TRUE(eventually([&] { return tracker->status().state != LinkState::connected; }));
  server = NdiServer::start({.port = port, .on_cables = {"femur"}}).value();
  const std::jthread playing = player(*server, {"femur"});
  const auto until_then = state_of(board, "femur").accepted;
  EXPECT_TRUE(eventually([&] { return state_of(board, "femur").accepted > until_then + 3; }));
}

TEST(NdiClient, DeviceWithoutToolsIsSaid) {
  const auto server = NdiServer::start({}).value();
  PoseBoard board;
  const auto tracker = a_tracker(server->port(), board);
  EXPECT_TRUE(eventually([&] { return tracker->status().trouble.find("has no tool") != std::string::npos; }));
}

/// A device behind a line that changes what it says.
class DisturbedDevice {
 public:
  using Disturb = std::function<std::string(std::string_view command, std::string reply)>;
  DisturbedDevice(NdiDevice device, Disturb disturb)
      : device_(std::move(device)), disturb_(std::move(disturb)), thread_([this] { run(); }) {}
  ~DisturbedDevice() {
    asio::error_code ignored;
    peer_.acceptor.close(ignored);
    if (connected_) peer_.socket.shutdown(asio::ip::tcp::socket::shutdown_both, ignored);
  }
  std::uint16_t port() const { return port_; }

 private:
  void run() try {
    peer_.accept();
    connected_ = true;
    std::string received;
    for (int i = 0;; ++i) {
      const std::size_t size = asio::read_until(peer_.socket, asio::dynamic_buffer(received), '\r');
      const std::string command = received.substr(0, size);
      received.erase(0, size);
      device_.measure(std::get<IgtlTracking>(measured(i, {"femur"}).content));
      const std::string reply = disturb_(command, device_.answer(command));
      asio::write(peer_.socket, asio::buffer(reply));
    }
  } catch (const std::system_error&) {
  }

  NdiDevice device_;
  Disturb disturb_;
  RawPeer peer_;
  std::uint16_t port_ = peer_.port();
  std::atomic<bool> connected_ = false;
  std::jthread thread_;
};

TEST(NdiClient, DeviceThatKnowsOnlyTextIsAskedForText) {
  DisturbedDevice device(NdiDevice({"femur"}), [](std::string_view command, std::string reply) {
    return command.starts_with("BX") ? ndi_text_reply(std::string_view("ERROR01")) : reply;
  });
  PoseBoard board;
  const auto tracker = a_tracker(device.port(), board);
  EXPECT_TRUE(accepts(board, "femur"));
}

TEST(NdiClient, SingleDamagedReplyIsCountedAndLost) {
  int replies = 0;
  DisturbedDevice device(NdiDevice({"femur"}), [&](std::string_view command, std::string reply) {
    if (command.starts_with("BX") && ++replies % 3 == 0) reply[10] = char(reply[10] ^ 1);
    return reply;
  });
  PoseBoard board;
  const auto tracker = a_tracker(device.port(), board);
  EXPECT_TRUE(eventually([&] { return count_of(tracker->status().counters, "bad_crc") >= 3; }));
  EXPECT_TRUE(accepts(board, "femur"));
  EXPECT_EQ(count_of(tracker->status().counters, "connections"), 1u);
}

TEST(NdiClient, ToolPartlyOutOfTheVolumeIsHidden) {
  DisturbedDevice device(NdiDevice({"femur"}), [](std::string_view command, std::string reply) {
    if (!command.starts_with("BX")) return reply;
    NdiTracking tracking = ndi_tracking(reply).value();
    tracking.tools[0].port_status |= 0x80;
    return ndi_binary_reply(tracking);
  });
  PoseBoard board;
  const auto tracker = a_tracker(device.port(), board);
  EXPECT_TRUE(eventually([&] { return count_of(state_of(board, "femur").rejected, "hidden") >= 3; }));
  EXPECT_EQ(state_of(board, "femur").accepted, 0u);
}

TEST(NdiClient, WarmDeviceIsAStatus) {
  DisturbedDevice device(NdiDevice({"femur"}), [](std::string_view command, std::string reply) {
    if (!command.starts_with("BX")) return reply;
    NdiTracking tracking = ndi_tracking(reply).value();
    tracking.system_status = 0x0200;
    return ndi_binary_reply(tracking);
  });
  PoseBoard board;
  const auto tracker = a_tracker(device.port(), board);
  ASSERT_TRUE(eventually([&] { return board.status().has_value(); }));
  EXPECT_EQ(board.status()->text, "temperature out of range");
}

TEST(NdiClient, MissingDefinitionIsRefused) {
  PoseBoard board;
  const auto tracker =
      open_tracker({.address = "ndi:127.0.0.1", .definitions = {{"tool", "/nowhere.rom"}}}, onto(board));
  ASSERT_FALSE(tracker);
  EXPECT_EQ(tracker.error().reason, Reason::missing_file);
}

TEST(NdiClient, DefinitionOfAnotherTrackerIsRefused) {
  PoseBoard board;
  const auto tracker = open_tracker({.definitions = {{"tool", "tool.rom"}}}, onto(board));
  ASSERT_FALSE(tracker);
  EXPECT_EQ(tracker.error().reason, Reason::bad_value);
}

TEST(NdiClient, StopsWhileADeviceIsSilent) {
  RawPeer silent;
  PoseBoard board;
  const auto tracker = a_tracker(silent.port(), board);
  silent.accept();
  tracker->stop();
  EXPECT_EQ(count_of(tracker->status().counters, "connections"), 0u);
}

}  // namespace ndi_client_test
}  // namespace helicarm::tracker
