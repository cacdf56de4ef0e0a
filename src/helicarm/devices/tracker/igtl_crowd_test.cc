// SPDX-License-Identifier: Apache-2.0
#include <chrono>

#include <gtest/gtest.h>

#include "helicarm/devices/tracker/igtl_peers_test.h"
#include "helicarm/devices/tracker/igtl_samples_test.h"

namespace helicarm::tracker {
namespace igtl_crowd_test {

using asio::ip::tcp;

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
  std::string header = encode({"x", 0, IgtlUnknown{"STRING", ""}}).substr(0, IgtlHeader::size);
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
  peer.write(encode({"x", 0, IgtlUnknown{"STRING", "hold"}}));
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

}  // namespace igtl_crowd_test
}  // namespace helicarm::tracker
