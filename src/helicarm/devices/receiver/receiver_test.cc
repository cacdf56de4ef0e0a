// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/receiver.h"

#include <chrono>
#include <csignal>
#include <map>
#include <thread>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "helicarm/core/files.h"
#include "helicarm/devices/receiver/receiver_fixture.h"

namespace helicarm::receiver {
namespace {

namespace fs = std::filesystem;

using Receiver = ReceiverAtWork;

TEST_F(Receiver, AnswersEchoAndReleases) {
  RawClient client = associated();
  client.send(peer::echo());
  EXPECT_EQ(client.receive_status(), 0);
  client.send(peer::release());
  EXPECT_EQ(client.receive_type(), released);
  EXPECT_EQ(client.receive_type(), closed);
  EXPECT_EQ(receiver_->counters().echoed, 1u);
}

TEST_F(Receiver, IsIdleOnceThePeersHaveReleased) {
  using std::chrono::milliseconds;
  RawClient client = associated();
  EXPECT_FALSE(receiver_->await_idle(milliseconds(1)));
  std::thread release([&] {
    client.send(peer::release());
    EXPECT_EQ(client.receive_type(), released);
  });
  EXPECT_TRUE(receiver_->await_idle(milliseconds(30000)));
  release.join();
}

TEST_F(Receiver, ImageIsOnDiskWhenItIsAcknowledged) {
  RawClient client = associated();
  client.send(peer::store(xray::DicomBuilder()));
  EXPECT_EQ(client.receive_status(), 0);
  const std::string file = read_file(folder_ / "2.25.17.dcm", 1 << 20).value();
  EXPECT_TRUE(file.ends_with(peer::data_set(xray::DicomBuilder())));
  EXPECT_EQ(receiver_->counters().stored, 1u);
}

TEST_F(Receiver, ImageInManySmallFragmentsIsTheSame) {
  RawClient client = associated();
  const std::string command = peer::command(1, xa_class, "2.25.17"),
                    set = peer::data_set(xray::DicomBuilder());
  for (const char c : command.substr(0, command.size() - 1))
    client.send(peer::pdu(data, peer::fragment(3, 1, {c})));
  client.send(peer::pdu(data, peer::fragment(3, 3, {command.back()})));
  for (const char c : set) client.send(peer::pdu(data, peer::fragment(3, 0, {c})));
  client.send(peer::pdu(data, peer::fragment(3, 2, "")));
  EXPECT_EQ(client.receive_status(), 0);
  EXPECT_TRUE(fs::exists(folder_ / "2.25.17.dcm"));
}

TEST_F(Receiver, RetransmissionIsAcknowledgedAndStoredOnce) {
  RawClient client = associated();
  for (int i = 0; i < 2; ++i) {
    client.send(peer::store(xray::DicomBuilder()));
    EXPECT_EQ(client.receive_status(), 0);
  }
  EXPECT_EQ(receiver_->counters().repeated, 1u);
}

TEST_F(Receiver, CallsTheHookForEachImage) {
  std::vector<Arrival> arrivals;
  std::vector<Failure> failures;
  receiver_ = DicomReceiver::open(options_, *inbox_,
                                  {[&](const Arrival& a) { arrivals.push_back(a); },
                                   [&](const Failure& f) { failures.push_back(f); }})
                  .value();
  RawClient client = associated();
  client.send(peer::store(xray::DicomBuilder()));
  client.receive_status();
  client.send(peer::store(xray::DicomBuilder().word(0x00280010, 0)));
  client.receive_status();
  ASSERT_EQ(arrivals.size(), 1u);
  ASSERT_EQ(failures.size(), 1u);
  EXPECT_EQ(arrivals[0].path.filename(), "2.25.17.dcm");
}

TEST_F(Receiver, BadImageIsRefusedWithAStatusAndTheAssociationContinues) {
  RawClient client = associated();
  client.send(peer::store(xray::DicomBuilder().word(0x00280010, 65535)));
  EXPECT_EQ(client.receive_status(), 0xC000);
  client.send(peer::store(xray::DicomBuilder()));
  EXPECT_EQ(client.receive_status(), 0);
}

TEST_F(Receiver, DifferingUidsOfCommandAndDataAreRefused) {
  RawClient client = associated();
  client.send(peer::store(xray::DicomBuilder(), "2.25.18"));
  EXPECT_EQ(client.receive_status(), 0xA900);
}

TEST_F(Receiver, ClassThatWasNotNegotiatedIsRefused) {
  RawClient client = associated();
  client.send(peer::store(xray::DicomBuilder(), "2.25.17", "1.2.840.10008.5.1.4.1.1.2"));
  EXPECT_EQ(client.receive_status(), 0x0122);
}

TEST_F(Receiver, UnknownOperationIsRefused) {
  RawClient client = associated();
  client.send(peer::pdu(data, peer::fragment(1, 3, peer::command(0x20, verification_class))));
  EXPECT_EQ(client.receive_status(), 0x0211);
}

TEST_F(Receiver, FullDiskIsOutOfResources) {
  // No file may grow, not even root's.
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit usual;
  ::getrlimit(RLIMIT_FSIZE, &usual);
  const rlimit full{100, usual.rlim_max};
  RawClient client = associated();
  ::setrlimit(RLIMIT_FSIZE, &full);
  client.send(peer::store(xray::DicomBuilder()));
  EXPECT_EQ(client.receive_status(), 0xA700);
  ::setrlimit(RLIMIT_FSIZE, &usual);
  client.send(peer::store(xray::DicomBuilder()));
  EXPECT_EQ(client.receive_status(), 0);
}

TEST_F(Receiver, InboxDeletedInOperationIsAnErrorAndNotRecreated) {
  RawClient client = associated();
  fs::remove_all(folder_);
  client.send(peer::store(xray::DicomBuilder()));
  EXPECT_EQ(client.receive_status(), 0xA700);
  EXPECT_FALSE(fs::exists(folder_));
  EXPECT_EQ(line_with("deleted or replaced").reason, Reason::cannot_write);
}

TEST_F(Receiver, WrongTitlesAreRejected) {
  peer::Request request;
  request.called = peer::padded("ANOTHER");
  EXPECT_EQ(answer_to(request.bytes()), rejected);
  options_.negotiation.peers = {"SOMEBODY"};
  open();
  EXPECT_EQ(answer_to(peer::Request().bytes()), rejected);
}

TEST_F(Receiver, OtherProtocolsAreAborted) {
  EXPECT_EQ(answer_to("GET / HTTP/1.1\r\nHost: here\r\n\r\n"), aborted);
  EXPECT_EQ(answer_to(std::string("\x16\3\1\2\0\1\0\1\xfc\3\3", 11)), aborted);  // TLS
  EXPECT_EQ(answer_to(peer::pdu(0x99, "abcd")), aborted);
  EXPECT_EQ(answer_to(peer::echo()), aborted);                            // before associating
  EXPECT_EQ(answer_to(std::string("\1\0\xFF\xFF\xFF\xFF", 6)), aborted);  // 4 GB
  EXPECT_EQ(answer_to(peer::pdu(1, "")), aborted);
  EXPECT_EQ(answer_to(peer::pdu(1, peer::Request().body().substr(0, 90))), aborted);
  expect_alive();
}

TEST_F(Receiver, ProtocolViolationsAbortTheAssociation) {
  EXPECT_EQ(answer_in_association(peer::Request().bytes()), aborted);
  EXPECT_EQ(answer_in_association(std::string("\4\0\x7F\xFF\xFF\xFF", 6)), aborted);
  EXPECT_EQ(answer_in_association(peer::pdu(data, std::string("\0\0\0\x40\1\3", 6))), aborted);
  EXPECT_EQ(answer_in_association(peer::pdu(data, peer::fragment(99, 3, "abc"))), aborted);
  EXPECT_EQ(answer_in_association(peer::pdu(data, peer::fragment(3, 2, "data first"))), aborted);
  EXPECT_EQ(answer_in_association(peer::pdu(data, peer::fragment(3, 3, "no command"))), aborted);
  expect_alive();
}

TEST_F(Receiver, AbortDuringAnImageLeavesNothing) {
  RawClient client = associated();
  client.send(peer::pdu(data, peer::fragment(3, 3, peer::command(1, xa_class, "2.25.17"))));
  client.send(peer::pdu(data, peer::fragment(3, 0, peer::data_set(xray::DicomBuilder()).substr(0, 100))));
  client.send(peer::pdu(aborted, std::string(4, '\0')));
  EXPECT_EQ(client.receive_type(), closed);
  EXPECT_FALSE(fs::exists(folder_ / "2.25.17.dcm"));
}

TEST_F(Receiver, ImageAboveTheLimitAbortsTheAssociation) {
  options_.most_object_bytes = 100;
  open();
  RawClient client = associated();
  client.send(peer::store(xray::DicomBuilder()));
  EXPECT_EQ(client.receive_type(), aborted);
  EXPECT_FALSE(fs::exists(folder_ / "2.25.17.dcm"));
}

TEST_F(Receiver, LargestPduOfZeroIsUnlimitedAndOfOneByteIsRejected) {
  peer::Request request;
  request.most_pdu_bytes = 0;
  RawClient unlimited(receiver_->port());
  unlimited.send(request.bytes());
  ASSERT_EQ(unlimited.receive_type(), accepted);
  unlimited.send(peer::echo());
  EXPECT_EQ(unlimited.receive_status(), 0);
  request.most_pdu_bytes = 1;
  EXPECT_EQ(answer_to(request.bytes()), rejected);
}

TEST_F(Receiver, StalledPeersBlockNoOtherAndAreDisconnected) {
  options_.request_limit_s = options_.idle_limit_s = 0.3;
  open();
  RawClient silent = client(), half = client(), idle = associated();
  half.send(peer::Request().bytes().substr(0, 20));
  expect_alive();
  EXPECT_EQ(silent.receive_type(), closed);
  EXPECT_EQ(half.receive_type(), closed);
  EXPECT_EQ(idle.receive_type(), closed);
  expect_alive();
}

TEST_F(Receiver, PeerThatSendsByteByByteIsDisconnected) {
  options_.request_limit_s = options_.idle_limit_s = 0.3;
  open();
  RawClient request = client(), image = associated();
  const auto begun = std::chrono::steady_clock::now();
  for (int i = 0; i < 25; ++i) {
    request.send(peer::Request().bytes().substr(static_cast<std::size_t>(i), 1));
    image.send(peer::store(xray::DicomBuilder()).substr(static_cast<std::size_t>(i), 1));
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  EXPECT_EQ(request.receive_type(), closed);
  EXPECT_EQ(image.receive_type(), closed);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, std::chrono::seconds(5));
  expect_alive();
}

TEST_F(Receiver, TwoHundredPeersAreServedUpToTheLimitAndTheOthersRejected) {
  options_.spared_s = 3600;
  open();
  std::vector<RawClient> peers;
  for (int i = 0; i < 200; ++i) {
    peers.push_back(client());
    peers.back().send(peer::Request().bytes());
  }
  std::map<int, unsigned> answers;
  for (RawClient& peer : peers) ++answers[peer.receive_type()];
  EXPECT_EQ(answers[accepted], options_.most_of_address);
  EXPECT_EQ(answers[accepted] + answers[rejected] + answers[closed], 200u);
  peers.clear();
  for (int i = 0; i < 1000 && answer_to(peer::Request().bytes()) != accepted; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  expect_alive();
}

TEST_F(Receiver, FloodOfEchoesIsAnsweredAndBlocksNoPeer) {
  constexpr int flood = 2000;
  RawClient flooding = associated();
  std::string echoes;
  for (int i = 0; i < flood; ++i) echoes += peer::echo();
  std::jthread sender([&] { flooding.send(echoes); });
  expect_alive();
  for (int i = 0; i < flood; ++i) ASSERT_EQ(flooding.receive_status(), 0) << i;
  EXPECT_EQ(receiver_->counters().echoed, flood + 1u);
}

TEST_F(Receiver, AssociationsAboveTheLimitAreRejected) {
  options_.most_associations = 2;
  options_.spared_s = 3600;
  open();
  RawClient first = associated(), second = associated(), third = client();
  third.send(peer::Request().bytes());
  const auto [type, body] = third.receive();
  EXPECT_EQ(type, rejected);
  EXPECT_EQ(body, std::string("\0\2\3\2", 4));
  first.send(peer::release());
  first.receive_type();
  EXPECT_EQ(first.receive_type(), closed);
  RawClient fourth = client();
  fourth.send(peer::Request().bytes());
  EXPECT_EQ(fourth.receive_type(), accepted);
}

TEST_F(Receiver, PortInUseIsReported) {
  ReceiverOptions same = options_;
  same.port = receiver_->port();
  const auto second = DicomReceiver::open(same, *inbox_);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().reason, Reason::port_taken);
  EXPECT_NE(second.error().message.find(std::to_string(same.port)), std::string::npos);
}

TEST_F(Receiver, InvalidAddressAndTlsFilesAreReported) {
  ReceiverOptions bad = options_;
  bad.address = "knee";
  EXPECT_EQ(DicomReceiver::open(bad, *inbox_).error().reason, Reason::bad_value);
  bad = options_;
  bad.tls = TlsFiles{"/nowhere/cert.pem", "/nowhere/key.pem", "/nowhere/ca.pem"};
  EXPECT_EQ(DicomReceiver::open(bad, *inbox_).error().reason, Reason::bad_value);
}

TEST_F(Receiver, ClosesImmediatelyWithPeersConnected) {
  RawClient idle = associated(), silent = client();
  receiver_.reset();
  EXPECT_EQ(idle.receive_type(), closed);
}

}  // namespace
}  // namespace helicarm::receiver
