// SPDX-License-Identifier: Apache-2.0
#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>

#include <asio.hpp>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/devices/tracker/igtl_client.h"
#include "helicarm/devices/tracker/igtl_samples_test.h"
#include "helicarm/devices/tracker/igtl_server.h"
#include "helicarm/devices/tracker/pose_board.h"

namespace helicarm::tracker {
namespace {

using asio::ip::tcp;

/// Waits for a condition on another thread, with a timeout far above the expected time.
template <class Condition>
bool eventually(Condition condition) {
  const double since = monotonic_seconds();
  while (!condition()) {
    if (monotonic_seconds() - since > 20) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

std::uint64_t count_of(const Counters& counters, const std::string& name) {
  const auto found = counters.find(name);
  return found == counters.end() ? 0 : found->second;
}

std::unique_ptr<IgtlServer> a_server(const IgtlServerOptions& options = {}) {
  return *IgtlServer::start(options);
}

/// A client that stores received messages.
struct Listener {
  explicit Listener(std::uint16_t port, IgtlClientOptions options = {}) {
    options.port = port;
    options.first_pause_s = 0.01;
    client = *IgtlClient::start(options, [this](const IgtlMessage& message, double) {
      const std::lock_guard lock(mutex);
      bytes += encode(message);
      last = message.device;
      ++count;
    });
  }
  bool connects() const {
    return eventually([&] { return client->status().state == LinkState::connected; });
  }
  std::string last_device() {
    const std::lock_guard lock(mutex);
    return last;
  }

  std::mutex mutex;
  std::string bytes, last;
  std::atomic<int> count = 0;
  std::unique_ptr<IgtlClient> client;
};

/// A peer that sends raw bytes.
struct RawPeer {
  asio::io_context io;
  tcp::acceptor acceptor{io, {asio::ip::address_v4::loopback(), 0}};
  tcp::socket socket{io};

  std::uint16_t port() const { return acceptor.local_endpoint().port(); }
  void accept() { socket = acceptor.accept(); }
  void dial(std::uint16_t port) {
    socket.connect({asio::ip::address_v4::loopback(), port});
    socket.set_option(tcp::no_delay(true));
  }
  void write(std::string_view bytes) { asio::write(socket, asio::buffer(bytes)); }
  bool is_disconnected() {
    asio::error_code error;
    char byte = 0;
    while (!error) socket.read_some(asio::buffer(&byte, 1), error);
    return true;
  }
};

bool all_connected(const IgtlServer& server, std::size_t clients) {
  return eventually([&] { return server.status().clients == clients; });
}

TEST(IgtlSockets, EveryKindOfMessageArrives) {
  IgtlServerOptions options;
  options.tracking_on_request = false;
  const auto server = a_server(options);
  Listener listener(server->port());
  ASSERT_TRUE(all_connected(*server, 1));
  std::string expected;
  for (const IgtlMessage& message : sample_messages()) {
    server->send(message);
    expected += encode(message);
  }
  ASSERT_TRUE(eventually([&] { return listener.count == static_cast<int>(sample_messages().size()); }));
  EXPECT_EQ(listener.bytes, expected);
}

TEST(IgtlSockets, TrackingIsSentToSubscribers) {
  const auto server = a_server();
  IgtlClientOptions asking;
  asking.ask_for_tracking = true;
  Listener asks(server->port(), asking), does_not(server->port());
  ASSERT_TRUE(all_connected(*server, 2));
  ASSERT_TRUE(eventually([&] { return asks.count == 1; }));  // RTS_TDATA
  server->send({"tracker", 0, IgtlTracking{}});
  server->send({"end", 0, IgtlString{"."}});
  ASSERT_TRUE(eventually([&] { return asks.count == 3 && does_not.count == 1; }));
  asks.client->send({"", 0, IgtlStop{"TDATA"}});
  ASSERT_TRUE(eventually([&] { return asks.count == 4; }));
  server->send({"tracker", 0, IgtlTracking{}});
  server->send({"end", 0, IgtlString{"."}});
  ASSERT_TRUE(eventually([&] { return asks.count == 5; }));
  EXPECT_EQ(asks.last_device(), "end");
}

TEST(IgtlSockets, ClientThatAskedForNothingReceivesATransformOfEachTool) {
  const auto server = a_server();
  Listener listener(server->port());
  ASSERT_TRUE(all_connected(*server, 1));
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose(0, 3) = 7;
  server->send({"tracker", 5, IgtlTracking{{{"femur", 1, pose}, {"tool", 1, pose}}}});
  ASSERT_TRUE(eventually([&] { return listener.count == 2; }));
  EXPECT_EQ(listener.bytes,
            encode({"femur", 5, IgtlTransform{pose}}) + encode({"tool", 5, IgtlTransform{pose}}));
}

TEST(IgtlSockets, QuaternionsAreServedToTheirSubscribers) {
  const auto server = a_server();
  Listener listener(server->port());
  ASSERT_TRUE(listener.connects());
  listener.client->send({"", 0, IgtlStart{"QTDATA", 0}});
  ASSERT_TRUE(eventually([&] { return listener.count == 1; }));  // RTS_QTDATA
  Eigen::Matrix4d turned = Eigen::Matrix4d::Identity(), scaled = 2 * Eigen::Matrix4d::Identity();
  turned.topLeftCorner<2, 2>() << -1, 0, 0, -1;
  turned(2, 3) = 900;
  server->send({"tracker", 5, IgtlTracking{{{"femur", 1, turned}, {"tool", 1, scaled}}}});
  ASSERT_TRUE(eventually([&] { return listener.count == 2; }));
  EXPECT_TRUE(listener.bytes.ends_with(
      encode({"tracker", 5, IgtlQuaternions{{{"femur", 1, {0, 0, 900}, {0, 0, 1, 0}}}}})));
}

TEST(IgtlSockets, StatusIsAnswered) {
  const auto server = a_server();
  Listener listener(server->port());
  ASSERT_TRUE(listener.connects());
  listener.client->send({"tracker", 0, IgtlGet{"STATUS"}});
  ASSERT_TRUE(eventually([&] { return listener.count == 1; }));
  EXPECT_EQ(listener.last_device(), "tracker");
}

TEST(IgtlSockets, PortInUseIsReportedAndFreeAgainAfterStop) {
  const auto server = a_server();
  IgtlServerOptions same;
  same.port = server->port();
  const auto second = IgtlServer::start(same);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().reason, Reason::port_taken);
  EXPECT_NE(second.error().message.find(std::to_string(same.port)), std::string::npos);
  server->stop();
  EXPECT_TRUE(IgtlServer::start(same));
}

TEST(IgtlSockets, AddressMustBeNumeric) {
  IgtlServerOptions named;
  named.address = "tracker.example";
  EXPECT_EQ(IgtlServer::start(named).error().reason, Reason::bad_value);
  IgtlClientOptions client;
  client.address = "tracker.example";
  EXPECT_EQ(IgtlClient::start(client, {}).error().reason, Reason::bad_value);
}

TEST(IgtlSockets, StopsInEveryState) {
  const auto server = a_server();
  Listener connected(server->port());
  ASSERT_TRUE(connected.connects());
  connected.client->stop();
  const auto port = server->port();
  server->stop();
  server->stop();
  Listener waiting(port);
  ASSERT_TRUE(eventually([&] { return count_of(waiting.client->status().counters, "attempts") > 2; }));
  EXPECT_EQ(waiting.client->status().state == LinkState::connected, false);
  EXPECT_FALSE(waiting.client->status().trouble.empty());
}

TEST(IgtlSockets, RestartedServerWithOtherNamesIsFoundAgain) {
  auto server = a_server();
  IgtlServerOptions same;
  same.port = server->port();
  Listener listener(same.port);
  for (int round = 0; round < 3; ++round) {
    ASSERT_TRUE(all_connected(*server, 1));
    const std::string name = fmt::format("name {}", round);
    server->send({name, 0, IgtlTransform{}});
    ASSERT_TRUE(eventually([&] { return listener.last_device() == name; }));
    server.reset();
    server = a_server(same);
  }
  EXPECT_GE(count_of(listener.client->status().counters, "connections"), 3u);
  // Counted after processing.
  EXPECT_TRUE(eventually([&] { return count_of(listener.client->status().counters, "messages") == 3; }));
}

TEST(IgtlSockets, PausesGrowUntilAMessageComes) {
  IgtlClientOptions options;
  std::vector<double> pauses;
  for (double pause = options.first_pause_s; pauses.size() < 8; pause = next_pause(pause, options))
    pauses.push_back(pause);
  EXPECT_EQ(pauses, (std::vector<double>{0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 5, 5}));
}

TEST(IgtlSockets, ServerThatDisconnectsIsRetried) {
  RawPeer peer;
  Listener listener(peer.port());
  for (int i = 0; i < 4; ++i) {
    peer.accept();
    peer.socket.close();
  }
  peer.accept();
  peer.write(encode({"at last", 0, IgtlTransform{}}));
  ASSERT_TRUE(eventually([&] { return listener.count == 1; }));
}

TEST(IgtlSockets, SilentServerIsDisconnected) {
  RawPeer peer;
  IgtlClientOptions options;
  options.silence_s = 0.05;
  Listener listener(peer.port(), options);
  peer.accept();
  EXPECT_TRUE(peer.is_disconnected());
  peer.accept();
  EXPECT_GE(count_of(listener.client->status().counters, "silences"), 1u);
}

TEST(IgtlSockets, FragmentedMessagesAreJoined) {
  RawPeer peer;
  Listener listener(peer.port());
  peer.accept();
  peer.socket.set_option(tcp::no_delay(true));
  std::string expected;
  for (const IgtlMessage& message : sample_messages()) {
    const std::string bytes = encode(message);
    for (const char byte : bytes) peer.write({&byte, 1});
    expected += bytes;
  }
  const std::string whole = encode({"last", 0, IgtlTransform{}});
  peer.write(whole.substr(0, 61));
  peer.write(whole.substr(61));
  ASSERT_TRUE(eventually([&] { return listener.last_device() == "last"; }));
  EXPECT_EQ(listener.bytes, expected + whole);
}

TEST(IgtlSockets, InvalidDataEndsTheConnectionAndNotTheClient) {
  RawPeer peer;
  Listener listener(peer.port());
  std::string huge = encode({"x", 0, IgtlTransform{}});
  huge[42] = '\x80';
  for (const std::string& nonsense :
       {huge, std::string(58, '\xff'),
        std::string("HTTP/1.1 400 Bad Request\r\nContent-Type: text/html; charset=utf-8\r\n")}) {
    peer.accept();
    peer.write(nonsense);
    EXPECT_TRUE(peer.is_disconnected());
  }
  peer.accept();
  peer.write(encode({"sound", 0, IgtlTransform{}}));
  ASSERT_TRUE(eventually([&] { return listener.last_device() == "sound"; }));
}

TEST(IgtlSockets, DamagedMessageBetweenValidOnesIsCounted) {
  RawPeer peer;
  Listener listener(peer.port());
  peer.accept();
  std::string spoiled = encode({"spoiled", 0, IgtlTransform{}});
  spoiled.back() ^= 1;
  peer.write(spoiled + encode({"sound", 0, IgtlTransform{}}));
  ASSERT_TRUE(eventually([&] { return listener.last_device() == "sound"; }));
  ASSERT_TRUE(eventually([&] { return count_of(listener.client->status().counters, "wrong_crc") == 1; }));
}

TEST(IgtlSockets, FloodIsReceivedCompletely) {
  RawPeer peer;
  PoseBoard board;
  IgtlClientOptions options;
  options.port = peer.port();
  std::atomic<int> count = 0;
  const auto client = *IgtlClient::start(options, [&](const IgtlMessage& message, double arrival_s) {
    board.take(message, arrival_s);
    ++count;
  });
  peer.accept();
  constexpr int flood = 20000;
  std::string bytes;
  for (int i = 1; i <= flood; ++i) {
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix(2, 3) = 800 + 1e-3 * (i % 100);
    bytes += encode({"tool", 0, IgtlTransform{matrix}});
  }
  peer.write(bytes);
  ASSERT_TRUE(eventually([&] { return count == flood; }));
  EXPECT_EQ(board.tools(monotonic_seconds())[0].accepted, static_cast<unsigned>(flood));
}

TEST(IgtlSockets, ServerSurvivesManyConnections) {
  const auto server = a_server();
  for (int i = 0; i < 200; ++i) {
    RawPeer peer;
    peer.dial(server->port());
    if (i % 3 == 0) peer.write(std::string(100, '\xff'));
    if (i % 3 == 1) peer.write(encode(sample_messages()[0]).substr(0, 70));
  }
  Listener listener(server->port());
  // Some connections may still wait to be accepted: the listener comes after them.
  ASSERT_TRUE(eventually([&] {
    server->send({"still here", 0, IgtlTransform{}});
    return listener.last_device() == "still here";
  }));
  EXPECT_TRUE(all_connected(*server, 1));
}

TEST(IgtlSockets, ClientsAboveTheLimitAreRejected) {
  IgtlServerOptions options;
  options.max_clients = 2;
  options.stall_s = 3600;
  const auto server = a_server(options);
  RawPeer first, second, third;
  first.dial(server->port());
  second.dial(server->port());
  ASSERT_TRUE(all_connected(*server, 2));
  third.dial(server->port());
  EXPECT_TRUE(third.is_disconnected());
  EXPECT_EQ(count_of(server->status().counters, "refused"), 1u);
}

TEST(IgtlSockets, ClientThatDoesNotReadBlocksNoOther) {
  IgtlServerOptions options;
  options.queue_messages = 4;
  const auto server = a_server(options);
  RawPeer sleeper;
  sleeper.socket.open(tcp::v4());
  sleeper.socket.set_option(asio::socket_base::receive_buffer_size(4096));
  sleeper.dial(server->port());
  Listener listener(server->port());
  ASSERT_TRUE(all_connected(*server, 2));
  const IgtlMessage large{"large", 0, IgtlUnknown{"LARGE", std::string(500000, 'x')}};
  int sent = 0;
  while (count_of(server->status().counters, "dropped") == 0 && sent < 1000) {
    server->send(large);
    ++sent;
    ASSERT_TRUE(eventually([&] { return listener.count == sent; }));
  }
  EXPECT_LT(sent, 1000);
}

TEST(IgtlSockets, StalledClientIsDisconnected) {
  IgtlServerOptions options;
  options.stall_s = 0.05;
  const auto server = a_server(options);
  RawPeer sleeper;
  sleeper.dial(server->port());
  ASSERT_TRUE(all_connected(*server, 1));
  const IgtlMessage large{"large", 0, IgtlUnknown{"LARGE", std::string(1000000, 'x')}};
  EXPECT_TRUE(eventually([&] {
    server->send(large);
    return server->status().clients == 0;
  }));
}

TEST(IgtlSockets, DisconnectedClientIsCountedAndLogged) {
  IgtlServerOptions options;
  options.stall_s = 0.05;
  std::atomic<int> notes = 0;
  options.on_notice = [&](const std::string& line) {
    notes += line.find("client 127.0.0.1:") == 0 && line.find("does not read") != line.npos;
  };
  const auto server = a_server(options);
  RawPeer sleeper;
  sleeper.dial(server->port());
  ASSERT_TRUE(all_connected(*server, 1));
  const IgtlMessage large{"large", 0, IgtlUnknown{"LARGE", std::string(1000000, 'x')}};
  EXPECT_TRUE(eventually([&] {
    server->send(large);
    return server->status().clients == 0;
  }));
  EXPECT_EQ(notes, 1);
  EXPECT_EQ(count_of(server->status().counters, "cut"), 1u);
}

TEST(IgtlSockets, BytesQueuedForAClientAreBounded) {
  IgtlServerOptions options;
  options.queue_bytes = 1000000;
  options.stall_s = 3600;
  const auto server = a_server(options);
  RawPeer sleeper;
  sleeper.dial(server->port());
  ASSERT_TRUE(all_connected(*server, 1));
  const IgtlMessage large{"large", 0, IgtlUnknown{"LARGE", std::string(400000, 'x')}};
  for (int i = 0; i < 100; ++i) server->send(large);
  // 40 MB exceed the socket buffers, one million bytes being sent and one million queued.
  EXPECT_TRUE(eventually([&] { return count_of(server->status().counters, "dropped") > 50; }));
}

TEST(IgtlSockets, MessageOverTheServersLimitEndsTheConnection) {
  const auto server = a_server();
  RawPeer peer;
  peer.dial(server->port());
  std::string header = encode({"x", 0, IgtlImage{}}).substr(0, IgtlHeader::size);
  header[45] = 16;  // body of over 1 MiB
  peer.write(header);
  EXPECT_TRUE(peer.is_disconnected());
  EXPECT_TRUE(eventually([&] { return count_of(server->status().counters, "cut") == 1; }));
}

TEST(IgtlSockets, MessagesAStalledServerCannotSendAreDropped) {
  IgtlServerOptions options;
  options.unsent_messages = 10;
  std::atomic<bool> held = false, free = false;
  auto server = IgtlServer::start(options, [&](const IgtlMessage&) {
                  held = true;
                  while (!free) std::this_thread::sleep_for(std::chrono::milliseconds(1));
                }).value();
  RawPeer peer;
  peer.dial(server->port());
  peer.write(encode({"x", 0, IgtlString{"hold"}}));
  ASSERT_TRUE(eventually([&] { return held.load(); }));
  for (int i = 0; i < 1000; ++i) server->send({"pose", 0, IgtlTransform{}});
  EXPECT_EQ(count_of(server->status().counters, "unsent"), 990u);
  free = true;
  EXPECT_TRUE(eventually([&] { return count_of(server->status().counters, "sent") == 10; }));
}

TEST(IgtlSockets, ClientIdleForLongestIsReplacedOnAFullServer) {
  IgtlServerOptions options;
  options.max_clients = 2;
  options.stall_s = 0.05;
  const auto server = a_server(options);
  RawPeer oldest, old;
  oldest.dial(server->port());
  ASSERT_TRUE(all_connected(*server, 1));
  old.dial(server->port());
  ASSERT_TRUE(all_connected(*server, 2));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  Listener listener(server->port());
  EXPECT_TRUE(oldest.is_disconnected());
  ASSERT_TRUE(eventually([&] {
    server->send({"still here", 0, IgtlTransform{}});
    return listener.last_device() == "still here";
  }));
  EXPECT_EQ(count_of(server->status().counters, "evicted"), 1u);
}

}  // namespace
}  // namespace helicarm::tracker
