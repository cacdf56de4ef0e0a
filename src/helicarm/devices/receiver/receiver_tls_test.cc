// SPDX-License-Identifier: Apache-2.0

#include <asio/ssl.hpp>
#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include "helicarm/devices/receiver/dimse.h"
#include "helicarm/devices/receiver/receiver_fixture.h"

namespace helicarm::receiver {
namespace {

namespace fs = std::filesystem;

/// A key and a self-signed certificate, which is its own authority.
TlsFiles self_signed(const fs::path& folder, const std::string& name) {
  const TlsFiles files{folder / (name + ".pem"), folder / (name + ".key"), folder / (name + ".pem")};
  EVP_PKEY* const key = EVP_EC_gen("P-256");
  X509* const certificate = X509_new();
  X509_set_version(certificate, 2);
  ASN1_INTEGER_set(X509_get_serialNumber(certificate), 1);
  X509_gmtime_adj(X509_getm_notBefore(certificate), -3600);
  X509_gmtime_adj(X509_getm_notAfter(certificate), 3600);
  X509_set_pubkey(certificate, key);
  X509_NAME* const subject = X509_get_subject_name(certificate);
  X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC,
                             reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
  X509_set_issuer_name(certificate, subject);
  X509_sign(certificate, key, EVP_sha256());
  const auto write = [](const fs::path& path, auto&& put) {
    std::FILE* const file = std::fopen(path.c_str(), "w");
    put(file);
    std::fclose(file);
  };
  write(files.certificate, [&](std::FILE* file) { PEM_write_X509(file, certificate); });
  write(files.key,
        [&](std::FILE* file) { PEM_write_PrivateKey(file, key, nullptr, nullptr, 0, nullptr, nullptr); });
  X509_free(certificate);
  EVP_PKEY_free(key);
  return files;
}

class ReceiverTls : public ReceiverAtWork {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    options_.tls = ours_ = self_signed(folder_, "ours");
    ReceiverAtWork::SetUp();
  }
  /// PDU type of the answer to an association request by a client with this certificate, or none.
  int answer_over_tls(const std::optional<TlsFiles>& shown) const {
    asio::ssl::context context(asio::ssl::context::tls_client);
    if (shown) {
      context.use_certificate_file(shown->certificate.string(), asio::ssl::context::pem);
      context.use_private_key_file(shown->key.string(), asio::ssl::context::pem);
    }
    asio::io_context io;
    asio::ssl::stream<asio::ip::tcp::socket> stream(io, context);
    stream.next_layer().connect({asio::ip::address_v4::loopback(), receiver_->port()});
    asio::error_code error;
    stream.handshake(decltype(stream)::client, error);
    if (error) return closed;
    asio::write(stream, asio::buffer(peer::Request().bytes()), error);
    char type = 0;
    asio::read(stream, asio::buffer(&type, 1), error);
    return error ? closed : type;
  }

  TlsFiles ours_;
};

TEST_F(ReceiverTls, PeerWithACertificateOfTheAuthorityIsAccepted) {
  EXPECT_EQ(answer_over_tls(ours_), accepted);
}

TEST_F(ReceiverTls, PeerWithoutACertificateIsRefusedAndReported) {
  EXPECT_EQ(answer_over_tls(std::nullopt), closed);
  const Failure line = line_with("TLS handshake");
  EXPECT_EQ(line.reason, Reason::not_connected);
  EXPECT_EQ(line.message.find("127.0.0.1: connection ended: TLS handshake: "), 0u) << line.message;
}

TEST_F(ReceiverTls, CertificateOfAnotherAuthorityIsRefusedAndReported) {
  EXPECT_EQ(answer_over_tls(self_signed(folder_, "stranger")), closed);
  EXPECT_EQ(line_with("TLS handshake: certificate: ").reason, Reason::not_connected);
}

TEST_F(ReceiverTls, StorageCommitmentIsReportedOverTls) {
  asio::io_context io;
  asio::ip::tcp::acceptor archive(io, {asio::ip::address_v4::loopback(), 0});
  options_.report_peers = {{"C_ARM", "127.0.0.1", archive.local_endpoint().port()}};
  open();
  asio::ssl::context context(asio::ssl::context::tls);
  context.use_certificate_file(ours_.certificate.string(), asio::ssl::context::pem);
  context.use_private_key_file(ours_.key.string(), asio::ssl::context::pem);
  asio::ssl::stream<asio::ip::tcp::socket> asks(io, context), listens(io, context);
  asks.next_layer().connect({asio::ip::address_v4::loopback(), receiver_->port()});
  asks.handshake(decltype(asks)::client);
  peer::Request request;
  request.contexts +=
      peer::context(5, std::string(commitment_class), std::string(dicom::implicit_little_endian));
  asio::write(asks, asio::buffer(request.bytes()));
  const std::string reference = dicom::element(
      0xFFFEE000, dicom::element(0x00081150, xa_class) + dicom::element(0x00081155, "2.25.17"));
  asio::write(asks, asio::buffer(peer::commit(dicom::element(0x00081195, "2.25.99") +
                                              dicom::element(0x00081199, reference))));
  archive.accept(listens.next_layer());
  listens.handshake(decltype(listens)::server);
  char type = 0;
  asio::read(listens, asio::buffer(&type, 1));
  EXPECT_EQ(type, 1);
}

TEST_F(ReceiverTls, ConnectionWithoutTlsIsRefusedAndReported) {
  RawClient plain = client();
  plain.send(peer::Request().bytes());
  plain.receive_type();
  EXPECT_EQ(line_with("TLS handshake").reason, Reason::not_connected);
}

}  // namespace
}  // namespace helicarm::receiver
