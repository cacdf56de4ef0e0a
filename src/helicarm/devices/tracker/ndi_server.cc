// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/ndi_server.h"

#include <mutex>
#include <set>
#include <thread>

#include <asio.hpp>
#include <fmt/format.h>

#include "helicarm/core/real_time.h"
#include "helicarm/devices/tracker/igtl_connection.h"
#include "helicarm/devices/tracker/ndi_device.h"

namespace helicarm::tracker {
namespace {

constexpr std::size_t longest_command = 1024;

}  // namespace

struct NdiServer::Impl {
  struct Session {
    Session(asio::ip::tcp::socket peer, const std::vector<std::string>& on_cables)
        : socket(std::move(peer)), device(on_cables) {}

    asio::ip::tcp::socket socket;
    NdiDevice device;
    std::string received, reply;
  };

  explicit Impl(const NdiServerOptions& server_options) : options(server_options) {}

  void accept();
  void read(const std::shared_ptr<Session>& session);
  void answer(const std::shared_ptr<Session>& session, std::size_t size);
  void end(const std::shared_ptr<Session>& session);
  void count(const char* event);

  const NdiServerOptions options;
  asio::io_context io{1};
  asio::ip::tcp::acceptor acceptor{io};
  std::set<std::shared_ptr<Session>> sessions;
  mutable std::mutex mutex;  ///< guards the devices and the next member
  Counters counters;
  std::uint16_t port = 0;
  std::jthread thread;
};

void NdiServer::Impl::count(const char* event) {
  const std::lock_guard lock(mutex);
  ++counters[event];
}

void NdiServer::Impl::accept() {
  acceptor.async_accept([this](asio::error_code error, asio::ip::tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error && sessions.size() < options.most_clients) {
      asio::error_code ignored;
      socket.set_option(asio::ip::tcp::no_delay(true), ignored);
      const auto session = std::make_shared<Session>(std::move(socket), options.on_cables);
      {
        const std::lock_guard lock(mutex);
        sessions.insert(session);
      }
      count("connections");
      read(session);
    } else {
      count("refused");
    }
    accept();
  });
}

void NdiServer::Impl::read(const std::shared_ptr<Session>& session) {
  asio::async_read_until(session->socket, asio::dynamic_buffer(session->received, longest_command), '\r',
                         [this, session](asio::error_code error, std::size_t size) {
                           if (error) return end(session);
                           answer(session, size);
                         });
}

void NdiServer::Impl::answer(const std::shared_ptr<Session>& session, std::size_t size) {
  count("commands");
  {
    const std::lock_guard lock(mutex);
    session->reply = session->device.answer(std::string_view(session->received).substr(0, size));
  }
  session->received.erase(0, size);
  asio::async_write(session->socket, asio::buffer(session->reply),
                    [this, session](asio::error_code error, std::size_t) {
                      if (error) return end(session);
                      read(session);
                    });
}

void NdiServer::Impl::end(const std::shared_ptr<Session>& session) {
  const std::lock_guard lock(mutex);
  sessions.erase(session);
}

NdiServer::NdiServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
NdiServer::~NdiServer() { stop(); }

Expected<std::unique_ptr<NdiServer>> NdiServer::start(const NdiServerOptions& options) {
  const auto endpoint = endpoint_of(options.address, options.port);
  if (!endpoint) return tl::unexpected(endpoint.error());
  auto impl = std::make_unique<Impl>(options);
  try {
    impl->acceptor = asio::ip::tcp::acceptor(impl->io, *endpoint);
    impl->port = impl->acceptor.local_endpoint().port();
  } catch (const std::system_error& error) {
    return fail(Reason::port_taken,
                fmt::format("port {} of {}: {}", options.port, options.address, error.code().message()));
  }
  impl->accept();
  impl->thread = std::jthread([raw = impl.get()] {
    const RealTime priority;
    raw->io.run();
  });
  return std::unique_ptr<NdiServer>(new NdiServer(std::move(impl)));
}

std::uint16_t NdiServer::port() const { return impl_->port; }

void NdiServer::send(const IgtlMessage& message) {
  const auto* const tracking = std::get_if<IgtlTracking>(&message.content);
  if (!tracking) return;
  const std::lock_guard lock(impl_->mutex);
  for (const auto& session : impl_->sessions) session->device.measure(*tracking);
}

Counters NdiServer::counters() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->counters;
}

void NdiServer::stop() {
  impl_->io.stop();
  if (impl_->thread.joinable()) impl_->thread.join();
}

}  // namespace helicarm::tracker
