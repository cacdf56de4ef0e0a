// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/commitment.h"

#include <fmt/format.h>

#include "helicarm/devices/receiver/dimse.h"
#include "helicarm/devices/receiver/pdu.h"
#include "helicarm/devices/receiver/receiver_fixture.h"

namespace helicarm::receiver {
namespace {

using xray::DicomBuilder;

const std::string class_uid(commitment_class);
const std::string instance_uid(commitment_instance);
const std::string implicit_syntax = "1.2.840.10008.1.2";

std::string referenced(const std::string& sop_class, const std::string& sop_instance) {
  return dicom::element(0xFFFEE000,
                        dicom::element(0x00081150, sop_class) + dicom::element(0x00081155, sop_instance));
}

/// Data set of an N-ACTION for these items.
std::string asked(const std::string& items) {
  return dicom::element(0x00081195, "2.25.99") + dicom::element(0x00081199, items);
}

/// The data set of a report that answers `asked`.
std::string report_of(const std::string& failed, const std::string& committed) {
  return dicom::element(0x00081195, "2.25.99") + (failed.empty() ? "" : dicom::element(0x00081198, failed)) +
         (committed.empty() ? "" : dicom::element(0x00081199, committed));
}

std::string failed_item(const std::string& sop_class, const std::string& sop_instance, int reason) {
  return dicom::element(0xFFFEE000, dicom::element(0x00081150, sop_class) +
                                        dicom::element(0x00081155, sop_instance) +
                                        dicom::element(0x00081197, DicomBuilder::number(reason, 2)));
}

/// Event type of an N-EVENT-REPORT command.
int event_of(const std::string& body) {
  const std::size_t at = body.find(std::string("\0\0\2\x10\2\0\0\0", 8));
  return at == std::string::npos ? -1 : static_cast<unsigned char>(body[at + 8]);
}

class StorageCommitment : public ReceiverAtWork {
 protected:
  RawClient committing() const {
    RawClient client(receiver_->port());
    peer::Request request;
    request.contexts += peer::context(5, class_uid, implicit_syntax);
    client.send(request.bytes());
    EXPECT_EQ(client.receive_type(), accepted);
    return client;
  }
  RawClient with_an_image() const {
    RawClient client = committing();
    client.send(peer::store(DicomBuilder()));
    EXPECT_EQ(client.receive_status(), 0);
    return client;
  }
};

TEST_F(StorageCommitment, StoredImageIsReportedOnTheSameAssociation) {
  RawClient client = with_an_image();
  client.send(peer::commit(asked(referenced(xa_class, "2.25.17"))));
  EXPECT_EQ(client.receive_status(), 0);
  EXPECT_EQ(event_of(client.receive().second), 1);
  const std::string report = report_of("", referenced(xa_class, "2.25.17"));
  EXPECT_EQ(client.receive().second, peer::fragment(5, 2, report));
  EXPECT_EQ(receiver_->counters().commitments, 1u);
}

TEST_F(StorageCommitment, AssociationGoesOnAfterTheReport) {
  RawClient client = with_an_image();
  client.send(peer::commit(asked(referenced(xa_class, "2.25.17"))));
  for (int pdu = 0; pdu < 3; ++pdu) client.receive();
  client.send(peer::pdu(4, peer::fragment(5, 3, peer::command(0x8100, class_uid))));
  client.send(peer::echo());
  EXPECT_EQ(client.receive_status(), 0);
}

TEST_F(StorageCommitment, UnknownImageFailsAndTheOtherIsCommitted) {
  RawClient client = with_an_image();
  client.send(peer::commit(asked(referenced(xa_class, "2.25.17") + referenced(xa_class, "2.25.18"))));
  EXPECT_EQ(client.receive_status(), 0);
  EXPECT_EQ(event_of(client.receive().second), 2);
  EXPECT_EQ(client.receive().second,
            peer::fragment(
                5, 2, report_of(failed_item(xa_class, "2.25.18", 0x0112), referenced(xa_class, "2.25.17"))));
}

TEST_F(StorageCommitment, ImageOfAnotherClassFails) {
  const std::string dx_class = "1.2.840.10008.5.1.4.1.1.1.1";
  RawClient client = with_an_image();
  client.send(peer::commit(asked(referenced(dx_class, "2.25.17"))));
  EXPECT_EQ(client.receive_status(), 0);
  EXPECT_EQ(event_of(client.receive().second), 2);
  EXPECT_EQ(client.receive().second,
            peer::fragment(5, 2, report_of(failed_item(dx_class, "2.25.17", 0x0119), "")));
}

TEST_F(StorageCommitment, ReplacedInboxCommitsNothing) {
  RawClient client = with_an_image();
  std::filesystem::rename(folder_, folder_.string() + "-aside");
  std::filesystem::create_directory(folder_);
  client.send(peer::commit(asked(referenced(xa_class, "2.25.17"))));
  EXPECT_EQ(client.receive_status(), 0);
  EXPECT_EQ(event_of(client.receive().second), 2);
  EXPECT_EQ(client.receive().second,
            peer::fragment(5, 2, report_of(failed_item(xa_class, "2.25.17", 0x0110), "")));
  std::filesystem::remove_all(folder_.string() + "-aside");
}

TEST_F(StorageCommitment, ImageIsFoundAfterARestart) {
  with_an_image();
  open();
  RawClient client = committing();
  client.send(peer::commit(asked(referenced(xa_class, "2.25.17"))));
  EXPECT_EQ(client.receive_status(), 0);
  EXPECT_EQ(event_of(client.receive().second), 1);
}

TEST_F(StorageCommitment, WrongRequestsAreRefused) {
  RawClient client = committing();
  const std::string one = asked(referenced(xa_class, "2.25.17"));
  const auto status_of = [&](const std::string& bytes) {
    client.send(bytes);
    return client.receive_status();
  };
  EXPECT_EQ(status_of(peer::commit(one, 2)), 0x0123);
  EXPECT_EQ(status_of(peer::commit(one, 1, "2.25.1")), 0x0112);
  EXPECT_EQ(status_of(peer::commit(asked(""))), 0x0115);
  EXPECT_EQ(status_of(peer::commit(dicom::element(0x00081199, referenced(xa_class, "2.25.17")))), 0x0115);
  EXPECT_EQ(status_of(peer::commit(asked(referenced(xa_class, "../../x")))), 0x0115);
  EXPECT_EQ(status_of(peer::commit("not a data set")), 0x0115);
}

TEST_F(StorageCommitment, TooManyReferencesAreRefused) {
  RawClient client = committing();
  std::string items;
  for (std::size_t i = 0; i <= most_references; ++i) items += referenced(xa_class, fmt::format("2.25.{}", i));
  std::string data_set = asked(items);
  const std::string whole = peer::commit("");
  client.send(whole.substr(0, whole.size() - peer::pdu(4, peer::fragment(5, 2, "")).size()));
  for (; data_set.size() > 60000; data_set.erase(0, 60000))
    client.send(peer::pdu(4, peer::fragment(5, 0, data_set.substr(0, 60000))));
  client.send(peer::pdu(4, peer::fragment(5, 2, data_set)));
  EXPECT_EQ(client.receive_status(), 0x0115);
}

TEST_F(StorageCommitment, RequestOverItsLimitIsAborted) {
  RawClient client = committing();
  const std::string whole = peer::commit("");
  client.send(whole.substr(0, whole.size() - peer::pdu(4, peer::fragment(5, 2, "")).size()));
  for (int i = 0; i < 18; ++i) client.send(peer::pdu(4, peer::fragment(5, 0, std::string(60000, '\0'))));
  EXPECT_EQ(client.receive_type(), aborted);
}

TEST_F(StorageCommitment, OnlyTheImplicitSyntaxIsAccepted) {
  peer::Request request;
  request.contexts += peer::context(5, class_uid, explicit_syntax);
  RawClient client(receiver_->port());
  client.send(request.bytes());
  const auto [type, body] = client.receive();
  EXPECT_EQ(type, accepted);
  EXPECT_NE(body.find(std::string("\x21\0\0\x19\5\0\4\0", 8)), std::string::npos);
}

/// A peer that listens for reports.
class Archive {
 public:
  Archive() : acceptor_(context_, {asio::ip::address_v4::loopback(), 0}) {}
  std::uint16_t port() const { return acceptor_.local_endpoint().port(); }
  void accept() { acceptor_.accept(socket_); }
  std::pair<int, std::string> receive() {
    std::string header(6, '\0');
    asio::read(socket_, asio::buffer(header));
    BigEndianReader reader(header);
    const int type = reader.take<std::uint8_t>();
    reader.take(1);
    std::string body(reader.take<std::uint32_t>(), '\0');
    asio::read(socket_, asio::buffer(body));
    return {type, body};
  }
  void send(const std::string& bytes) { asio::write(socket_, asio::buffer(bytes)); }

 private:
  asio::io_context context_;
  asio::ip::tcp::acceptor acceptor_;
  asio::ip::tcp::socket socket_{context_};
};

TEST_F(StorageCommitment, KnownPeerIsToldOnAnAssociationToIt) {
  Archive archive;
  options_.report_peers = {{"C_ARM", "127.0.0.1", archive.port()}};
  open();
  RawClient client = with_an_image();
  client.send(peer::commit(asked(referenced(xa_class, "2.25.17"))));
  EXPECT_EQ(client.receive_status(), 0);
  client.send(peer::release());
  EXPECT_EQ(client.receive_type(), released);

  archive.accept();
  const auto [type, body] = archive.receive();
  EXPECT_EQ(type, 1);
  const auto request = dicom::read_association_request(body);
  ASSERT_TRUE(request) << request.error().message;
  EXPECT_EQ(request->called, "C_ARM");
  EXPECT_EQ(request->calling, "HELICARM");
  ASSERT_EQ(request->contexts.size(), 1u);
  EXPECT_EQ(request->contexts[0].abstract_syntax, class_uid);
  const std::string provider = BigEndianWriter()
                                   .put(std::uint16_t{20})
                                   .put(class_uid)
                                   .put(std::uint8_t{0})
                                   .put(std::uint8_t{1})
                                   .bytes();
  EXPECT_NE(body.find(peer::item(0x54, provider)), std::string::npos);
  archive.send(dicom::associate_accept(
      *request, {{request->contexts[0].id, dicom::ContextResult::accepted, class_uid, implicit_syntax}},
      16384));
  EXPECT_EQ(event_of(archive.receive().second), 1);
  EXPECT_EQ(archive.receive().second, peer::fragment(1, 2, report_of("", referenced(xa_class, "2.25.17"))));
  archive.send(
      peer::pdu(4, peer::fragment(1, 3,
                                  peer::command_element(0x0100, DicomBuilder::number(0x8100, 2)) +
                                      peer::command_element(0x0120, DicomBuilder::number(1, 2)) +
                                      peer::command_element(0x0800, DicomBuilder::number(0x0101, 2)) +
                                      peer::command_element(0x0900, DicomBuilder::number(0, 2)))));
  EXPECT_EQ(archive.receive().first, 5);
  archive.send(peer::pdu(6, std::string(4, '\0')));
  EXPECT_TRUE(eventually([&] { return receiver_->counters().reported == 1; }));
}

TEST_F(StorageCommitment, ClosingTheReceiverEndsAReportOnTheWay) {
  Archive silent;
  options_.report_peers = {{"C_ARM", "127.0.0.1", silent.port()}};
  open();
  RawClient client = with_an_image();
  client.send(peer::commit(asked(referenced(xa_class, "2.25.17"))));
  EXPECT_EQ(client.receive_status(), 0);
  silent.accept();
  receiver_.reset();
}

TEST(DataSetData, IsCutToThePeersPduSize) {
  const std::string data(1200, 'x');
  const std::string pdus = dicom::data_set_data(5, data, 512);
  std::string read;
  for (std::string_view rest = pdus; !rest.empty();) {
    const auto header = dicom::read_pdu_header(rest.substr(0, 6));
    EXPECT_LE(header.length, 512u);
    const auto fragments = dicom::read_fragments(rest.substr(6, header.length));
    ASSERT_TRUE(fragments);
    read += fragments->front().bytes;
    rest.remove_prefix(6 + header.length);
    EXPECT_EQ(fragments->front().last, rest.empty());
  }
  EXPECT_EQ(read, data);
}

TEST(ReportPeer, IsReadFromText) {
  const auto peer = read_report_peer("ORTHANC=127.0.0.1:4242");
  ASSERT_TRUE(peer);
  EXPECT_EQ(peer->title, "ORTHANC");
  EXPECT_EQ(peer->address, "127.0.0.1");
  EXPECT_EQ(peer->port, 4242);
  EXPECT_EQ(read_report_peer("PACS=::1:104")->address, "::1");
  for (const char* wrong : {"", "ORTHANC", "ORTHANC=", "=127.0.0.1:1", "A=host:104", "A=127.0.0.1:0",
                            "A=127.0.0.1:70000", "A=127.0.0.1:1x", "A=127.0.0.1"})
    EXPECT_EQ(read_report_peer(wrong).error().reason, Reason::usage) << wrong;
}

}  // namespace
}  // namespace helicarm::receiver
