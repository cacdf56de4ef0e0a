// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "helicarm/devices/tracker/igtl_peers_test.h"
#include "helicarm/devices/tracker/igtl_samples_test.h"

namespace helicarm::tracker {
namespace igtl_client_test {

using asio::ip::tcp;

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

}  // namespace igtl_client_test
}  // namespace helicarm::tracker
