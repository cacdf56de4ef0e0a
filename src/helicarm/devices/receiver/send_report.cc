// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/send_report.h"

#include <array>
#include <optional>

#include <asio/experimental/awaitable_operators.hpp>
#include <asio/ip/tcp.hpp>
#include <asio/read.hpp>
#include <asio/redirect_error.hpp>
#include <asio/ssl/stream.hpp>
#include <asio/steady_timer.hpp>
#include <asio/this_coro.hpp>
#include <asio/use_awaitable.hpp>
#include <asio/write.hpp>
#include <fmt/format.h>

#include "helicarm/devices/receiver/dimse.h"
#include "helicarm/devices/receiver/pdu.h"

namespace helicarm::receiver {
namespace {

using asio::awaitable;
using asio::use_awaitable;
using asio::ip::tcp;

constexpr std::uint8_t context = 1;
constexpr std::size_t most_pdu_bytes = std::size_t{64} << 10;
constexpr std::array pauses{std::chrono::seconds(1), std::chrono::seconds(5), std::chrono::seconds(25)};

[[noreturn]] void refuse(std::string why) { throw BadInput(Reason::not_connected, std::move(why)); }

template <class Stream>
awaitable<std::string> take_pdu(Stream& stream, dicom::PduType expected) {
  std::array<char, dicom::pdu_header_bytes> header;
  co_await asio::async_read(stream, asio::buffer(header), use_awaitable);
  const auto [type, length] = dicom::read_pdu_header({header.data(), header.size()});
  if (type != static_cast<std::uint8_t>(expected) || length > most_pdu_bytes)
    refuse(fmt::format("answers with a PDU of type {} and {} bytes", type, length));
  std::string body(length, '\0');
  co_await asio::async_read(stream, asio::buffer(body), use_awaitable);
  co_return body;
}

template <class Stream>
awaitable<void> converse(Stream& stream, const ReportPeer& peer, const std::string& own_title,
                         const CommitmentReport& report) {
  const auto send = [&](const std::string& bytes) {
    return asio::async_write(stream, asio::buffer(bytes), use_awaitable);
  };
  const std::string request =
      dicom::associate_request(peer.title, own_title, {context, commitment_class, most_pdu_bytes});
  co_await send(request);
  const std::string answer = co_await take_pdu(stream, dicom::PduType::associate_accept);
  const dicom::AssociationAnswer accepted = value_or_throw(dicom::read_association_answer(answer));
  if (accepted.result != dicom::ContextResult::accepted) refuse("does not accept storage commitment");
  const std::string event =
      dicom::command_data(context,
                          dicom::write_event_report({1, std::string(commitment_class),
                                                     std::string(commitment_instance), report.event()})) +
      dicom::data_set_data(context, write_commitment_report(report), accepted.most_pdu_bytes);
  co_await send(event);
  const std::string response = co_await take_pdu(stream, dicom::PduType::data);
  std::string command;
  for (const dicom::Fragment& fragment : value_or_throw(dicom::read_fragments(response)))
    command += fragment.bytes;
  const dicom::Command read = value_or_throw(dicom::read_command(command));
  if (!read.is(dicom::Operation::event_report_response) || read.status != 0)
    refuse(fmt::format("answers with command {:04X}, status {:04X}", read.field, read.status));
  const std::string release = dicom::release_request();
  co_await send(release);
  co_await take_pdu(stream, dicom::PduType::release_answer);
}

awaitable<void> attempt(const ReportPeer& peer, const std::string& own_title, const CommitmentReport& report,
                        asio::ssl::context* tls) {
  tcp::socket socket(co_await asio::this_coro::executor);
  co_await socket.async_connect({asio::ip::make_address(peer.address), peer.port}, use_awaitable);
  if (!tls) {
    co_await converse(socket, peer, own_title, report);
    co_return;
  }
  asio::ssl::stream<tcp::socket> stream(std::move(socket), *tls);
  co_await stream.async_handshake(asio::ssl::stream_base::client, use_awaitable);
  co_await converse(stream, peer, own_title, report);
}

/// Why it failed; empty: reported.
awaitable<std::string> explained(const ReportPeer& peer, const std::string& own_title,
                                 const CommitmentReport& report, asio::ssl::context* tls) {
  try {
    co_await attempt(peer, own_title, report, tls);
    co_return "";
  } catch (const std::exception& failed) {
    co_return failed.what();
  }
}

}  // namespace

awaitable<std::string> send_report(ReportPeer peer, std::string own_title, CommitmentReport report,
                                   asio::ssl::context* tls, double limit_s) {
  using namespace asio::experimental::awaitable_operators;
  asio::steady_timer timer(co_await asio::this_coro::executor);
  const auto limit =
      std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::duration<double>(limit_s));
  for (std::size_t failures = 0;; ++failures) {
    timer.expires_after(limit);
    const auto first = co_await (explained(peer, own_title, report, tls) || timer.async_wait(use_awaitable));
    const std::string why = first.index() == 0 ? std::get<0>(first) : "no answer in time";
    if (why.empty() || failures == pauses.size()) co_return why;
    timer.expires_after(pauses[failures]);
    co_await timer.async_wait(use_awaitable);
  }
}

}  // namespace helicarm::receiver
