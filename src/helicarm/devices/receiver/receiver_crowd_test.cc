// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include "helicarm/devices/receiver/receiver_fixture.h"

namespace helicarm::receiver {
namespace {

using ReceiverCrowd = ReceiverAtWork;

std::string half_an_image(const std::string& patient = "CANARY^NAME") {
  const std::string set = peer::data_set(xray::DicomBuilder().text(0x00100010, "PN", patient));
  return peer::pdu(data, peer::fragment(3, 3, peer::command(1, xa_class, "2.25.17"))) +
         peer::pdu(data, peer::fragment(3, 0, set.substr(0, set.size() / 2)));
}
std::string other_half(const std::string& patient = "CANARY^NAME") {
  const std::string set = peer::data_set(xray::DicomBuilder().text(0x00100010, "PN", patient));
  return peer::pdu(data, peer::fragment(3, 2, set.substr(set.size() / 2)));
}

TEST_F(ReceiverCrowd, FiveHundredSilentConnectionsBlockNoPeer) {
  options_.request_limit_s = 3600;
  open();
  std::vector<RawClient> crowd;
  for (int i = 0; i < 500; ++i) crowd.push_back(client());
  RawClient c_arm = associated();
  c_arm.send(peer::store(xray::DicomBuilder()));
  EXPECT_EQ(c_arm.receive_status(), 0);
  EXPECT_TRUE(eventually([&] { return receiver_->counters().evicted >= 400; }));
}

TEST_F(ReceiverCrowd, AssociationsThatOnlyEchoAreReplacedForAnImage) {
  options_.most_of_address = 2;
  options_.spared_s = 0;
  open();
  RawClient first = associated(), second = associated();
  for (RawClient* echoing : {&first, &second, &first}) {
    echoing->send(peer::echo());
    EXPECT_EQ(echoing->receive_status(), 0);
  }
  RawClient c_arm = associated();
  c_arm.send(peer::store(xray::DicomBuilder()));
  EXPECT_EQ(c_arm.receive_status(), 0);
  EXPECT_EQ(first.receive_type(), closed);
  second.send(peer::echo());
  EXPECT_EQ(second.receive_status(), 0);
  EXPECT_EQ(line_with("replaced by another").reason, Reason::not_connected);
}

TEST_F(ReceiverCrowd, AssociationReceivingAnImageIsKept) {
  options_.most_of_address = 1;
  options_.spared_s = 0;
  open();
  RawClient c_arm = associated();
  c_arm.send(peer::echo() + half_an_image());
  EXPECT_EQ(c_arm.receive_status(), 0);
  ASSERT_TRUE(eventually([&] { return receiver_->counters().bytes_on_the_way > 0; }));  // of the image
  EXPECT_EQ(answer_to(peer::Request().bytes()), rejected);
  c_arm.send(other_half());
  EXPECT_EQ(c_arm.receive_status(), 0);
  EXPECT_EQ(answer_to(peer::Request().bytes()), accepted);
}

TEST_F(ReceiverCrowd, AssociationThatOnlyEchoesIsEnded) {
  options_.echo_limit_s = 0.2;
  open();
  RawClient echoing = associated();
  int status = 0;
  for (int i = 0; i < 3000 && status == 0; ++i) {
    echoing.send(peer::echo());
    status = echoing.receive_status();
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_EQ(status, -1);
  EXPECT_EQ(receiver_->counters().timed_out, 1u);
  EXPECT_EQ(line_with("no image for too long").reason, Reason::not_connected);
}

TEST_F(ReceiverCrowd, WithoutDescriptorsItWaitsAndRecovers) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer opens a pipe to probe the memory of an object";
#endif
  asio::io_context io;
  asio::ip::tcp::socket waiting(io, asio::ip::tcp::v4());
  rlimit usual;
  ::getrlimit(RLIMIT_NOFILE, &usual);
  const int lowest_free = ::dup(0);
  ::close(lowest_free);
  const rlimit none{static_cast<rlim_t>(lowest_free), usual.rlim_max};
  ::setrlimit(RLIMIT_NOFILE, &none);
  waiting.connect({asio::ip::address_v4::loopback(), receiver_->port()});
  EXPECT_TRUE(eventually([&] { return receiver_->counters().accept_failures > 0; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_LT(receiver_->counters().accept_failures, 10u);  // one per 100 ms, fewer on a loaded machine
  ::setrlimit(RLIMIT_NOFILE, &usual);
  asio::write(waiting, asio::buffer(peer::Request().bytes()));
  char type = 0;
  asio::read(waiting, asio::buffer(&type, 1));
  EXPECT_EQ(type, accepted);
  EXPECT_EQ(line_with("cannot be accepted").reason, Reason::not_connected);
}

TEST_F(ReceiverCrowd, EveryIncompleteImageIsReported) {
  const auto cut = [&](auto&& how, const std::string& words) {
    RawClient client = associated();
    client.send(peer::echo() + half_an_image());
    EXPECT_EQ(client.receive_status(), 0);
    how(client);
    const Failure line = line_with(words);
    EXPECT_EQ(line.reason, Reason::truncated) << words;
    EXPECT_NE(line.message.find("\"C_ARM\" (127.0.0.1): image truncated after"), std::string::npos)
        << line.message;
    EXPECT_EQ(line.message.find("CANARY"), std::string::npos);
  };
  cut([](RawClient& client) { client.send(peer::pdu(aborted, std::string(4, '\0'))); },
      "aborted by the peer");
  cut([](RawClient& client) { client.close(); }, "End of file");
  cut([](RawClient& client) { client.send(peer::release()); }, "released");
  cut([](RawClient& client) { client.send(peer::pdu(0x99, "")); }, "unknown PDU");
  cut([](RawClient& client) { client.send(peer::pdu(data, peer::fragment(3, 1, "x"))); },
      "unexpected fragment");
  options_.most_object_bytes = 100;
  open();
  RawClient large = associated();
  large.send(half_an_image());
  EXPECT_EQ(line_with("image over").reason, Reason::truncated);
  options_.most_object_bytes = 1 << 20;
  options_.object_limit_s = 0.1;
  open();
  RawClient slow = associated();
  slow.send(half_an_image());
  EXPECT_EQ(line_with("takes too long").reason, Reason::truncated);
}

TEST_F(ReceiverCrowd, ImageTruncatedByTheReceiversEndIsReported) {
  RawClient client = associated();
  client.send(half_an_image());
  ASSERT_TRUE(eventually([&] { return receiver_->counters().bytes_on_the_way > 0; }));
  receiver_.reset();
  EXPECT_EQ(line_with("the receiver is closing").reason, Reason::truncated);
}

TEST_F(ReceiverCrowd, ReleasedAssociationsAndEmptyConnectionsAreNotReported) {
  client().close();
  RawClient polite = associated();
  polite.send(peer::release());
  polite.receive_type();
  EXPECT_EQ(polite.receive_type(), closed);
  EXPECT_TRUE(eventually([&] { return receiver_->counters().aborted == 1; }));
  receiver_.reset();
  EXPECT_TRUE(lines().empty());
}

TEST_F(ReceiverCrowd, FloodOfConnectionsDoesNotFillTheLog) {
  constexpr int strangers = 300;
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < strangers; ++i) EXPECT_EQ(answer_to("GET / HTTP/1.1\r\n\r\n"), aborted);
  EXPECT_TRUE(eventually([&] { return receiver_->counters().aborted == strangers; }));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  EXPECT_GT(lines().size(), 0u);
  EXPECT_LE(static_cast<double>(lines().size()), 20 * (seconds + 2));
}

}  // namespace
}  // namespace helicarm::receiver
