// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include <asio/io_context.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/read.hpp>
#include <asio/write.hpp>

#include "helicarm/core/big_endian.h"
#include "helicarm/devices/receiver/commitment.h"
#include "helicarm/xray/dicom_builder.h"

namespace helicarm::receiver {

inline constexpr const char* xa_class = "1.2.840.10008.5.1.4.1.1.12.1";
inline constexpr const char* verification_class = "1.2.840.10008.1.1";
inline constexpr const char* explicit_syntax = "1.2.840.10008.1.2.1";

/// For tests: a peer's bytes, any of which can be invalid.
namespace peer {

inline std::string item(int type, const std::string& content) {
  return BigEndianWriter()
      .put(static_cast<std::uint8_t>(type))
      .put<std::uint8_t>(0)
      .put(static_cast<std::uint16_t>(content.size()))
      .put(content)
      .bytes();
}

inline std::string pdu(int type, const std::string& body) {
  return BigEndianWriter()
      .put(static_cast<std::uint8_t>(type))
      .put<std::uint8_t>(0)
      .put(static_cast<std::uint32_t>(body.size()))
      .put(body)
      .bytes();
}

inline std::string context(int id, const std::string& abstract_syntax,
                           const std::string& transfer_syntax = explicit_syntax) {
  return item(0x20, std::string{static_cast<char>(id), 0, 0, 0} + item(0x30, abstract_syntax) +
                        item(0x40, transfer_syntax));
}

inline std::string padded(std::string_view title) {
  return BigEndianWriter().put_name(title, 16, ' ').bytes();
}

struct Request {
  int version = 1;
  std::string called = padded("HELICARM");
  std::string calling = padded("C_ARM");
  std::string application = "1.2.840.10008.3.1.1.1";
  std::string contexts = context(1, verification_class) + context(3, xa_class);
  std::uint32_t most_pdu_bytes = 16384;

  std::string body() const {
    return BigEndianWriter()
        .put(static_cast<std::uint16_t>(version))
        .put<std::uint16_t>(0)
        .put(called)
        .put(calling)
        .put(std::string(32, '\0'))
        .put(item(0x10, application))
        .put(contexts)
        .put(item(0x50, item(0x51, BigEndianWriter().put(most_pdu_bytes).bytes())))
        .bytes();
  }
  std::string bytes() const { return pdu(1, body()); }
};

inline std::string fragment(int context, int control, const std::string& bytes) {
  return BigEndianWriter()
      .put(static_cast<std::uint32_t>(bytes.size() + 2))
      .put(static_cast<std::uint8_t>(context))
      .put(static_cast<std::uint8_t>(control))
      .put(bytes)
      .bytes();
}

inline std::string command_element(int number, std::string value) {
  if (value.size() % 2 != 0) value += '\0';
  return xray::DicomBuilder::number(0, 2) + xray::DicomBuilder::number(number, 2) +
         xray::DicomBuilder::number(static_cast<int>(value.size()), 4) + value;
}

inline std::string command(int field, const std::string& sop_class, const std::string& sop_instance = "") {
  const bool data = !sop_instance.empty();
  return command_element(0x0002, sop_class) + command_element(0x0100, xray::DicomBuilder::number(field, 2)) +
         command_element(0x0110, xray::DicomBuilder::number(7, 2)) +
         command_element(0x0800, xray::DicomBuilder::number(data ? 0 : 0x0101, 2)) +
         (data ? command_element(0x1000, sop_instance) : "");
}

/// Data set of a file made by the builder.
inline std::string data_set(const xray::DicomBuilder& builder) {
  const std::string file = builder.bytes();
  const std::size_t meta_size = static_cast<unsigned char>(file[140]);
  return file.substr(144 + meta_size);
}

inline std::string store(const xray::DicomBuilder& builder, const std::string& sop_instance = "2.25.17",
                         const std::string& sop_class = xa_class) {
  return pdu(4, fragment(3, 3, command(1, sop_class, sop_instance))) +
         pdu(4, fragment(3, 2, data_set(builder)));
}

/// N-ACTION of storage commitment in context 5.
inline std::string commit(const std::string& data_set, int type = 1,
                          const std::string& instance = std::string(commitment_instance)) {
  using xray::DicomBuilder;
  const std::string all = command_element(0x0003, std::string(commitment_class)) +
                          command_element(0x0100, DicomBuilder::number(0x0130, 2)) +
                          command_element(0x0110, DicomBuilder::number(9, 2)) +
                          command_element(0x0800, DicomBuilder::number(0, 2)) +
                          command_element(0x1001, instance) +
                          command_element(0x1008, DicomBuilder::number(type, 2));
  return pdu(4, fragment(5, 3, all)) + pdu(4, fragment(5, 2, data_set));
}

inline std::string echo() { return pdu(4, fragment(1, 3, command(0x30, verification_class))); }
inline std::string release() { return pdu(5, std::string(4, '\0')); }

}  // namespace peer

/// For tests: a TCP client without protocol logic.
class RawClient {
 public:
  explicit RawClient(std::uint16_t port) : socket_(*context_) {
    socket_.connect({asio::ip::address_v4::loopback(), port});
    socket_.set_option(asio::ip::tcp::no_delay(true));
  }
  void send(const std::string& bytes) {
    asio::error_code gone;
    asio::write(socket_, asio::buffer(bytes), gone);
  }
  /// Type and body of the next PDU; type 0 if the peer has closed.
  std::pair<int, std::string> receive() {
    asio::error_code error;
    std::string header(6, '\0');
    asio::read(socket_, asio::buffer(header), error);
    if (error) return {0, {}};
    BigEndianReader reader(header);
    const int type = reader.take<std::uint8_t>();
    reader.take(1);
    std::string body(reader.take<std::uint32_t>(), '\0');
    asio::read(socket_, asio::buffer(body), error);
    return {type, body};
  }
  int receive_type() { return receive().first; }
  /// Status of the next response.
  int receive_status() {
    const auto [type, body] = receive();
    const std::size_t at = body.find(std::string("\0\0\0\x09\2\0\0\0", 8));
    if (type != 4 || at == std::string::npos) return -1;
    return static_cast<unsigned char>(body[at + 8]) | static_cast<unsigned char>(body[at + 9]) << 8;
  }
  void close() { socket_.close(); }

 private:
  std::unique_ptr<asio::io_context> context_ = std::make_unique<asio::io_context>();
  asio::ip::tcp::socket socket_;
};

}  // namespace helicarm::receiver
