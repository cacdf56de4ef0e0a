// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/igtl_connection.h"

#include <fmt/format.h>
#include <netinet/tcp.h>

#include "helicarm/devices/tracker/pose_board.h"

namespace helicarm::tracker {

Expected<asio::ip::tcp::endpoint> endpoint_of(const std::string& address, std::uint16_t port) {
  asio::error_code error;
  const auto parsed = asio::ip::make_address(address == "localhost" ? "127.0.0.1" : address, error);
  if (error)
    return fail(Reason::bad_value,
                fmt::format("\"{}\" is not a numeric address; use one such as 127.0.0.1", address));
  return asio::ip::tcp::endpoint(parsed, port);
}

void add_counters(Counters& to, const Counters& more) {
  for (const auto& [name, count] : more) to[name] += count;
}

namespace {

/// TCP keep-alive: a peer that vanished, e.g. by a pulled cable, is detected after 30 s.
void expect_signs_of_life(asio::ip::tcp::socket& socket) {
  using Idle = asio::detail::socket_option::integer<IPPROTO_TCP, TCP_KEEPIDLE>;
  using Interval = asio::detail::socket_option::integer<IPPROTO_TCP, TCP_KEEPINTVL>;
  using Probes = asio::detail::socket_option::integer<IPPROTO_TCP, TCP_KEEPCNT>;
  asio::error_code ignored;
  socket.set_option(asio::socket_base::keep_alive(true), ignored);
  socket.set_option(Idle(15), ignored);
  socket.set_option(Interval(5), ignored);
  socket.set_option(Probes(3), ignored);
}

}  // namespace

void IgtlConnection::start(Handlers handlers) {
  handlers_ = std::move(handlers);
  open_ = true;
  heard_s_ = monotonic_seconds();
  asio::error_code ignored;
  socket_.set_option(asio::ip::tcp::no_delay(true), ignored);
  expect_signs_of_life(socket_);
  read();
}

void IgtlConnection::read() {
  socket_.async_read_some(asio::buffer(segment_),
                          [self = shared_from_this()](asio::error_code error, std::size_t size) {
                            if (!self->open_) return;
                            if (error) return self->close(error.message());
                            self->take(size);
                          });
}

void IgtlConnection::take(std::size_t size) {
  heard_s_ = monotonic_seconds();
  bytes_ += size;
  const auto fed = stream_.feed({segment_.data(), size}, handlers_.on_message);
  publish();
  if (!fed) return cut(fed.error().message);
  if (open_) read();
}

void IgtlConnection::send(std::shared_ptr<const std::string> bytes) {
  if (!open_) return;
  if (!in_flight_.empty() && monotonic_seconds() - writing_since_ > limits_.stall_s)
    return cut("the peer does not read");
  queued_bytes_ += bytes->size();
  queue_.push_back(std::move(bytes));
  while (queue_.size() > limits_.messages || queued_bytes_ > limits_.bytes) {
    queued_bytes_ -= queue_.front()->size();
    queue_.pop_front();
    ++dropped_;
    publish();
  }
  if (in_flight_.empty()) write();
}

void IgtlConnection::write() {
  if (queue_.empty()) return;
  in_flight_.assign(queue_.begin(), queue_.end());
  queue_.clear();
  queued_bytes_ = 0;
  writing_since_ = monotonic_seconds();
  std::vector<asio::const_buffer> buffers;
  for (const auto& bytes : in_flight_) buffers.push_back(asio::buffer(*bytes));
  asio::async_write(socket_, buffers, [self = shared_from_this()](asio::error_code error, std::size_t) {
    if (!self->open_) return;
    if (error) return self->close(error.message());
    self->sent_ += self->in_flight_.size();
    self->in_flight_.clear();
    self->taken_s_ = monotonic_seconds();
    self->publish();
    self->write();
  });
}

void IgtlConnection::cut(const std::string& why) {
  if (!open_) return;
  cut_ = true;
  publish();
  close(why);
}

void IgtlConnection::close(const std::string& why) {
  if (!std::exchange(open_, false)) return;
  queue_.clear();
  asio::error_code ignored;
  socket_.close(ignored);
  if (handlers_.on_closed) handlers_.on_closed(why);
}

void IgtlConnection::publish() {
  const std::lock_guard lock(mutex_);
  published_ = stream_.counters();
  published_["bytes"] = bytes_;
  published_["sent"] = sent_;
  published_["dropped"] = dropped_;
  if (cut_) published_["cut"] = 1;
}

Counters IgtlConnection::counters() const {
  const std::lock_guard lock(mutex_);
  return published_;
}

}  // namespace helicarm::tracker
