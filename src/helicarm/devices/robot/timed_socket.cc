// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/robot/timed_socket.h"

#include <array>
#include <optional>

#include <asio.hpp>
#include <fmt/format.h>

namespace helicarm::robot {

struct TimedSocket::Parts {
  asio::io_context io;
  asio::ip::tcp::socket socket{io};
  std::string peer;

  /// Runs until the started operation has ended or the time is over, then cancels it.
  void run_for(Duration patience) {
    io.restart();
    io.run_for(patience);
    if (io.stopped()) return;
    socket.cancel();
    io.run();
  }
  tl::unexpected<Failure> failed(const std::string& what, const std::error_code& error) const {
    const bool late = error == asio::error::operation_aborted || error == asio::error::would_block;
    return fail(Reason::not_connected,
                fmt::format("{}: {}: {}", peer, what, late ? "timeout" : error.message()));
  }
};

TimedSocket::TimedSocket(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}
TimedSocket::TimedSocket(TimedSocket&&) noexcept = default;
TimedSocket& TimedSocket::operator=(TimedSocket&&) noexcept = default;
TimedSocket::~TimedSocket() = default;

Expected<TimedSocket> TimedSocket::connect(const std::string& address, std::uint16_t port,
                                           Duration patience) {
  auto parts = std::make_unique<Parts>();
  parts->peer = fmt::format("{}:{}", address, port);
  std::error_code error;
  const auto ip = asio::ip::make_address(address == "localhost" ? "127.0.0.1" : address, error);
  if (error)
    return fail(Reason::bad_value, "\"" + address + "\" is not a robot address; use one such as 192.168.0.2");
  error = asio::error::would_block;
  parts->socket.async_connect({ip, port}, [&](const std::error_code& ended) { error = ended; });
  parts->run_for(patience);
  if (error) return parts->failed("cannot connect", error);
  parts->socket.set_option(asio::ip::tcp::no_delay(true), error);
  return TimedSocket(std::move(parts));
}

Expected<void> TimedSocket::send(std::string_view bytes, Duration patience) {
  std::error_code error = asio::error::would_block;
  asio::async_write(parts_->socket, asio::buffer(bytes),
                    [&](const std::error_code& ended, std::size_t) { error = ended; });
  parts_->run_for(patience);
  if (error) return parts_->failed("cannot send", error);
  return {};
}

Expected<std::string> TimedSocket::receive(Duration patience) {
  std::array<char, 4096> buffer;
  std::error_code error = asio::error::would_block;
  std::size_t size = 0;
  parts_->socket.async_read_some(asio::buffer(buffer), [&](const std::error_code& ended, std::size_t count) {
    error = ended;
    size = count;
  });
  parts_->run_for(patience);
  if (error && error != asio::error::operation_aborted) return parts_->failed("connection ended", error);
  return std::string(buffer.data(), size);
}

}  // namespace helicarm::robot
