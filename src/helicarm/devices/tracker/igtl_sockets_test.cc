// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "helicarm/devices/tracker/igtl_peers_test.h"
#include "helicarm/devices/tracker/igtl_samples_test.h"

namespace helicarm::tracker {
namespace igtl_sockets_test {

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
  server->send({"end", 0, IgtlUnknown{"STRING", "."}});
  ASSERT_TRUE(eventually([&] { return asks.count == 3 && does_not.count == 1; }));
  asks.client->send({"", 0, IgtlStop{"TDATA"}});
  ASSERT_TRUE(eventually([&] { return asks.count == 4; }));
  server->send({"tracker", 0, IgtlTracking{}});
  server->send({"end", 0, IgtlUnknown{"STRING", "."}});
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

}  // namespace igtl_sockets_test
}  // namespace helicarm::tracker
