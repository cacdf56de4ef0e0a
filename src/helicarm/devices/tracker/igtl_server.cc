// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/igtl_server.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <list>
#include <mutex>
#include <thread>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "helicarm/core/line_limit.h"
#include "helicarm/core/real_time.h"
#include "helicarm/devices/tracker/igtl_connection.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/devices/tracker/pose_gate.h"

namespace helicarm::tracker {
namespace {

using Bytes = std::shared_ptr<const std::string>;

Bytes encoded(const IgtlMessage& message) { return std::make_shared<const std::string>(encode(message)); }

bool is_tracking(const std::string& type) { return type == "TDATA" || type == "QTDATA"; }

/// Poses of TDATA or QTDATA.
std::vector<IgtlTool> tools_of(const IgtlContent& content) {
  if (const auto* tracking = std::get_if<IgtlTracking>(&content)) return tracking->tools;
  std::vector<IgtlTool> tools;
  for (const IgtlQuaternionTool& tool : std::get<IgtlQuaternions>(content).tools)
    tools.push_back({tool.name, tool.type, matrix_from(tool.position, tool.quaternion)});
  return tools;
}

IgtlQuaternions quaternions_of(const std::vector<IgtlTool>& tools) {
  IgtlQuaternions quaternions;
  for (const IgtlTool& tool : tools)
    if (const auto pose = rigid_pose(tool.matrix, std::numeric_limits<double>::infinity()))
      quaternions.tools.push_back(
          {tool.name, tool.type, pose->translation, Eigen::Quaterniond(pose->rotation).coeffs()});
  return quaternions;
}

/// Tracking of one type as another: "TDATA", "QTDATA", or "TRANSFORM" for each tool.
std::vector<IgtlMessage> converted(const IgtlMessage& message, const std::string& type) {
  const std::vector<IgtlTool> tools = tools_of(message.content);
  IgtlMessage other = message;
  if (type == "TDATA") {
    other.content = IgtlTracking{tools};
    return {other};
  }
  if (type == "QTDATA") {
    other.content = quaternions_of(tools);
    return {other};
  }
  std::vector<IgtlMessage> transforms;
  for (const IgtlTool& tool : tools) {
    other.device = tool.name;
    other.content = IgtlTransform{tool.matrix};
    transforms.push_back(other);
  }
  return transforms;
}

}  // namespace

struct IgtlServer::Impl {
  /// Whether a client requested one kind of tracking, and when the next message is due.
  struct Subscription {
    double interval_s = 0;
    double due_s = 0;

    bool take(double now_s) {
      // Tolerance for jitter: a source at exactly the requested rate must not lose every other pose.
      if (now_s < due_s - 0.1 * interval_s) return false;
      due_s = std::max(due_s, now_s - interval_s) + interval_s;
      return true;
    }
  };

  struct Client {
    std::shared_ptr<IgtlConnection> connection;
    std::string address;
    bool leaves = false;  ///< closed, and about to be removed from the list; used on the server's thread only
    std::map<std::string, Subscription> tracking = {};  ///< TDATA and QTDATA
    bool asks = false;                                  ///< has sent STT_ or STP_
  };

  Impl(const IgtlServerOptions& server_options, OnMessage message)
      : options(server_options), on_message(std::move(message)) {}

  Expected<void> listen(const asio::ip::tcp::endpoint& endpoint);
  void accept();
  void welcome(asio::ip::tcp::socket socket);
  bool make_room();
  void count(const char* what);
  void leave(std::list<Client>::iterator client, const std::string& why);
  void note(const std::string& line);
  void answer(Client& client, const IgtlMessage& message);
  void distribute(const IgtlMessage& message, const Bytes& bytes);

  const IgtlServerOptions options;
  const OnMessage on_message;
  asio::io_context io{1};
  asio::ip::tcp::acceptor acceptor{io};
  asio::steady_timer retry_timer{io};
  std::list<Client> clients;
  std::atomic<std::size_t> unsent = 0;
  LineLimit lines{20};
  std::uint16_t port = 0;

  mutable std::mutex mutex;  ///< guards the clients' list and the totals
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
    // Without file descriptors: retry when some are free.
    retry_timer.expires_after(std::chrono::milliseconds(100));
    retry_timer.async_wait([this](asio::error_code stopped) {
      if (!stopped) accept();
    });
  });
}

void IgtlServer::Impl::note(const std::string& line) {
  if (const auto left_out = lines.pass())
    options.on_notice(*left_out == 0 ? line : fmt::format("{} ({} lines omitted)", line, *left_out));
}

/// Whether there is room for another client; if not, the client idle for longest is disconnected.
bool IgtlServer::Impl::make_room() {
  const auto staying = std::ranges::count(clients, false, &Client::leaves);
  if (static_cast<std::size_t>(staying) < options.max_clients) return true;
  const double before = monotonic_seconds() - options.stall_s;
  const auto active = [](const Client& client) { return client.connection->active_s(); };
  auto longest = clients.end();
  for (auto it = clients.begin(); it != clients.end(); ++it)
    if (!it->leaves && active(*it) < before && (longest == clients.end() || active(*it) < active(*longest)))
      longest = it;
  const bool found = longest != clients.end();
  count(found ? "evicted" : "refused");
  if (found) longest->connection->cut("replaced by another client");
  return found;
}

void IgtlServer::Impl::count(const char* what) {
  const std::lock_guard lock(mutex);
  ++totals[what];
}

void IgtlServer::Impl::leave(std::list<Client>::iterator client, const std::string& why) {
  client->leaves = true;
  if (client->connection->was_cut()) note(fmt::format("client {}: disconnected: {}", client->address, why));
  // Posted: a connection can close while the list is iterated to send.
  asio::post(io, [this, client] {
    const std::lock_guard lock(mutex);
    add_counters(totals, client->connection->counters());
    clients.erase(client);
  });
}

void IgtlServer::Impl::welcome(asio::ip::tcp::socket socket) {
  asio::error_code gone;
  const auto peer = socket.remote_endpoint(gone);
  if (gone) return;
  const std::string address = fmt::format("{}:{}", peer.address().to_string(), peer.port());
  if (!make_room())
    return note(fmt::format("client {}: rejected: {} clients are connected", address, options.max_clients));
  count("connections");
  const ConnectionLimits limits{options.queue_messages, options.queue_bytes, options.stall_s,
                                options.body_bytes};
  const std::lock_guard lock(mutex);
  const auto client =
      clients.insert(clients.end(), {std::make_shared<IgtlConnection>(std::move(socket), limits), address});
  client->connection->start({[this, client](IgtlMessage&& message) {
                               answer(*client, message);
                               if (on_message) on_message(message);
                             },
                             [this, client](const std::string& why) { leave(client, why); }});
}

void IgtlServer::Impl::answer(Client& client, const IgtlMessage& message) {
  const auto reply = [&](IgtlContent content) {
    client.connection->send(encoded({message.device, 0, std::move(content), message.version}));
  };
  if (const auto* start = std::get_if<IgtlStart>(&message.content)) {
    client.asks = true;
    client.tracking[start->what] = {std::max(0, start->interval_ms) / 1000.0};
    reply(IgtlReply{start->what, 0});
  } else if (const auto* stop = std::get_if<IgtlStop>(&message.content)) {
    client.tracking.erase(stop->what);
    client.asks = true;
    if (is_tracking(stop->what)) reply(IgtlReply{stop->what, 0});
  } else if (const auto* get = std::get_if<IgtlGet>(&message.content); get && get->what == "STATUS") {
    reply(IgtlStatus{});
  }
}

void IgtlServer::Impl::distribute(const IgtlMessage& message, const Bytes& bytes) {
  const std::string own = type_of(message.content);
  if (!options.tracking_on_request || !is_tracking(own)) {
    for (Client& client : clients) client.connection->send(bytes);
    return;
  }
  std::map<std::string, std::vector<Bytes>> forms{{own, {bytes}}};
  const auto send = [&](Client& client, const std::string& type) {
    const auto [form, is_new] = forms.try_emplace(type);
    if (is_new)
      for (const IgtlMessage& other : converted(message, type)) form->second.push_back(encoded(other));
    for (const Bytes& each : form->second) client.connection->send(each);
  };
  const double now = monotonic_seconds();
  for (Client& client : clients) {
    for (auto& [type, subscription] : client.tracking)
      if (subscription.take(now)) send(client, type);
    if (!client.asks) send(client, "TRANSFORM");
  }
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
  impl->thread = std::jthread([raw = impl.get()] {
    const RealTime priority;
    raw->io.run();
  });
  return std::unique_ptr<IgtlServer>(new IgtlServer(std::move(impl)));
}

std::uint16_t IgtlServer::port() const { return impl_->port; }

void IgtlServer::send(const IgtlMessage& message) {
  if (++impl_->unsent > impl_->options.unsent_messages) {
    --impl_->unsent;
    return impl_->count("unsent");
  }
  asio::post(impl_->io, [impl = impl_.get(), message, bytes = encoded(message)] {
    --impl->unsent;
    impl->distribute(message, bytes);
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

}  // namespace helicarm::tracker
