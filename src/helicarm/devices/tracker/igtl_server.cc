// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/igtl_server.h"

#include <list>
#include <mutex>
#include <thread>

#include <fmt/format.h>

#include "helicarm/devices/tracker/igtl_connection.h"
#include "helicarm/devices/tracker/pose_board.h"

namespace helicarm {
namespace {

std::shared_ptr<const std::string> encoded(const IgtlMessage& message) {
  return std::make_shared<const std::string>(encode(message));
}

}  // namespace

struct IgtlServer::Impl {
  /// Whether a client wants one kind of tracking, and when next.
  struct Subscription {
    bool wanted = false;
    double interval_s = 0;
    double due_s = 0;

    bool take(double now_s) {
      if (!wanted) return false;
      // A source of the very rate asked for must not lose every other pose to its own jitter.
      if (now_s < due_s - 0.1 * interval_s) return false;
      due_s = std::max(due_s, now_s - interval_s) + interval_s;
      return true;
    }
  };

  struct Client {
    std::shared_ptr<IgtlConnection> connection;
    std::map<std::string, Subscription> tracking;  ///< by TDATA and QTDATA
  };

  Impl(const IgtlServerOptions& given, OnMessage message) : options(given), on_message(std::move(message)) {}

  Expected<void> listen(const asio::ip::tcp::endpoint& endpoint);
  void accept();
  void welcome(asio::ip::tcp::socket socket);
  void answer(Client& client, const IgtlMessage& message);
  void distribute(const std::string& type, const std::shared_ptr<const std::string>& bytes);

  const IgtlServerOptions options;
  const OnMessage on_message;
  asio::io_context io{1};
  asio::ip::tcp::acceptor acceptor{io};
  asio::steady_timer breath{io};
  std::list<Client> clients;
  std::uint16_t port = 0;

  mutable std::mutex mutex;  ///< of the clients' list and the totals
  Counters totals;
  std::jthread thread;
};

Expected<void> IgtlServer::Impl::listen(const asio::ip::tcp::endpoint& endpoint) {
  try {
    acceptor.open(endpoint.protocol());
    acceptor.set_option(asio::ip::tcp::acceptor::reuse_address(true));
    acceptor.bind(endpoint);
    acceptor.listen();
    port = acceptor.local_endpoint().port();
    return {};
  } catch (const asio::system_error& error) {
    return fail(Reason::port_taken,
                fmt::format("cannot listen at {} port {}: {}", endpoint.address().to_string(),
                            endpoint.port(), error.code().message()));
  }
}

void IgtlServer::Impl::accept() {
  acceptor.async_accept([this](asio::error_code error, asio::ip::tcp::socket socket) {
    if (error == asio::error::operation_aborted) return;
    if (!error) {
      welcome(std::move(socket));
      return accept();
    }
    // Out of file descriptors, say: try again when some are free.
    breath.expires_after(std::chrono::milliseconds(100));
    breath.async_wait([this](asio::error_code stopped) {
      if (!stopped) accept();
    });
  });
}

void IgtlServer::Impl::welcome(asio::ip::tcp::socket socket) {
  const std::lock_guard lock(mutex);
  if (clients.size() >= options.max_clients) {
    ++totals["refused"];
    return;
  }
  ++totals["connections"];
  SendLimits limits;
  limits.messages = options.queue_messages;
  limits.stall_s = options.stall_s;
  const auto client =
      clients.insert(clients.end(), {std::make_shared<IgtlConnection>(std::move(socket), limits), {}});
  client->connection->start({[this, client](IgtlMessage&& message) {
                               answer(*client, message);
                               if (on_message) on_message(message);
                             },
                             [this, client](const std::string&) {
                               // The list is walked when a connection closes while it is sent to.
                               asio::post(io, [this, client] {
                                 const std::lock_guard leaving(mutex);
                                 add_counters(totals, client->connection->counters());
                                 clients.erase(client);
                               });
                             }});
}

void IgtlServer::Impl::answer(Client& client, const IgtlMessage& message) {
  const auto reply = [&](IgtlContent content) {
    client.connection->send(encoded({message.device, 0, std::move(content), message.version}));
  };
  if (const auto* start = std::get_if<IgtlStart>(&message.content)) {
    client.tracking[start->what] = {true, std::max(0, start->interval_ms) / 1000.0};
    reply(IgtlReply{start->what, 0});
  } else if (const auto* stop = std::get_if<IgtlStop>(&message.content)) {
    client.tracking.erase(stop->what);
    if (stop->what == "TDATA" || stop->what == "QTDATA") reply(IgtlReply{stop->what, 0});
  } else if (const auto* get = std::get_if<IgtlGet>(&message.content); get && get->what == "STATUS") {
    reply(IgtlStatus{});
  }
}

void IgtlServer::Impl::distribute(const std::string& type, const std::shared_ptr<const std::string>& bytes) {
  const bool tracking = options.tracking_on_request && (type == "TDATA" || type == "QTDATA");
  const double now = monotonic_seconds();
  for (Client& client : clients)
    if (!tracking || client.tracking[type].take(now)) client.connection->send(bytes);
}

IgtlServer::IgtlServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
IgtlServer::~IgtlServer() { stop(); }

Expected<std::unique_ptr<IgtlServer>> IgtlServer::start(const IgtlServerOptions& options,
                                                        OnMessage on_message) {
  const auto endpoint = endpoint_of(options.address, options.port);
  if (!endpoint) return tl::unexpected(endpoint.error());
  auto impl = std::make_unique<Impl>(options, std::move(on_message));
  if (auto listening = impl->listen(*endpoint); !listening) return tl::unexpected(listening.error());
  impl->accept();
  impl->thread = std::jthread([raw = impl.get()] { raw->io.run(); });
  return std::unique_ptr<IgtlServer>(new IgtlServer(std::move(impl)));
}

std::uint16_t IgtlServer::port() const { return impl_->port; }

void IgtlServer::send(const IgtlMessage& message) {
  asio::post(impl_->io, [impl = impl_.get(), type = type_of(message.content), bytes = encoded(message)] {
    impl->distribute(type, bytes);
  });
}

IgtlServerStatus IgtlServer::status() const {
  const std::lock_guard lock(impl_->mutex);
  IgtlServerStatus status{impl_->clients.size(), impl_->totals};
  for (const Impl::Client& client : impl_->clients)
    add_counters(status.counters, client.connection->counters());
  return status;
}

void IgtlServer::stop() {
  impl_->io.stop();
  if (impl_->thread.joinable()) impl_->thread.join();
  asio::error_code ignored;
  impl_->acceptor.close(ignored);
  const std::lock_guard lock(impl_->mutex);
  impl_->clients.clear();
}

}  // namespace helicarm
