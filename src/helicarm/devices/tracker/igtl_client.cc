// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/igtl_client.h"

#include <mutex>
#include <thread>

#include "helicarm/core/real_time.h"
#include "helicarm/devices/tracker/igtl_connection.h"
#include "helicarm/devices/tracker/pose_board.h"

namespace helicarm::tracker {

std::string_view code(LinkState state) {
  switch (state) {
    case LinkState::connecting:
      return "connecting";
    case LinkState::connected:
      return "connected";
    case LinkState::waiting:
      return "waiting";
  }
  return "unknown";
}

struct IgtlClient::Impl {
  Impl(const IgtlClientOptions& client_options, const asio::ip::tcp::endpoint& to, OnMessage message,
       std::function<void()> connect)
      : options(client_options),
        endpoint(to),
        on_message(std::move(message)),
        on_connect(std::move(connect)),
        pause_s(client_options.first_pause_s) {}

  void connect();
  void connected(asio::ip::tcp::socket socket);
  void ended(const std::string& why);
  void watch_silence();
  /// Replaces the timer's pending action.
  void after(double seconds, std::function<void()> action);

  const IgtlClientOptions options;
  const asio::ip::tcp::endpoint endpoint;
  const OnMessage on_message;
  const std::function<void()> on_connect;

  asio::io_context io{1};
  asio::steady_timer timer{io};
  std::uint64_t timer_use = 0;
  std::shared_ptr<asio::ip::tcp::socket> dialling;
  double pause_s;

  mutable std::mutex mutex;  ///< guards the members below
  TrackerLinkStatus status;  ///< counters: of earlier connections, and of attempts
  std::shared_ptr<IgtlConnection> connection;
  std::jthread thread;
};

void IgtlClient::Impl::after(double seconds, std::function<void()> action) {
  timer.expires_after(
      std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(seconds)));
  timer.async_wait([this, use = ++timer_use, action = std::move(action)](asio::error_code error) {
    if (!error && use == timer_use) action();
  });
}

void IgtlClient::Impl::connect() {
  {
    const std::lock_guard lock(mutex);
    status.state = LinkState::connecting;
    ++status.counters["attempts"];
  }
  dialling = std::make_shared<asio::ip::tcp::socket>(io);
  after(options.connect_s, [this] {
    asio::error_code ignored;
    dialling->close(ignored);
  });
  dialling->async_connect(endpoint, [this, socket = dialling](asio::error_code error) {
    ++timer_use;
    if (error) return ended(error == asio::error::operation_aborted ? "no answer" : error.message());
    connected(std::move(*socket));
  });
}

void IgtlClient::Impl::connected(asio::ip::tcp::socket socket) {
  const auto fresh = std::make_shared<IgtlConnection>(std::move(socket), ConnectionLimits{});
  {
    const std::lock_guard lock(mutex);
    connection = fresh;
    status.state = LinkState::connected;
    ++status.counters["connections"];
  }
  if (on_connect) on_connect();
  fresh->start({[this](IgtlMessage&& message) {
                  pause_s = options.first_pause_s;
                  on_message(message, connection->heard_s());
                },
                [this](const std::string& why) { ended(why); }});
  if (options.ask_for_tracking)
    fresh->send(std::make_shared<std::string>(encode({"", 0, IgtlStart{"TDATA", options.interval_ms}})));
  if (options.silence_s > 0) watch_silence();
}

void IgtlClient::Impl::watch_silence() {
  after(connection->heard_s() + options.silence_s - monotonic_seconds(), [this] {
    if (monotonic_seconds() - connection->heard_s() < options.silence_s) return watch_silence();
    {
      const std::lock_guard lock(mutex);
      ++status.counters["silences"];
    }
    connection->close("no data");
  });
}

void IgtlClient::Impl::ended(const std::string& why) {
  {
    const std::lock_guard lock(mutex);
    if (connection) add_counters(status.counters, connection->counters());
    connection.reset();
    status.state = LinkState::waiting;
    status.trouble = why;
  }
  after(pause_s, [this] { connect(); });
  pause_s = next_pause(pause_s, options);
}

IgtlClient::IgtlClient(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
IgtlClient::~IgtlClient() { stop(); }

Expected<std::unique_ptr<IgtlClient>> IgtlClient::start(const IgtlClientOptions& options,
                                                        OnMessage on_message,
                                                        std::function<void()> on_connect) {
  const auto endpoint = endpoint_of(options.address, options.port);
  if (!endpoint) return tl::unexpected(endpoint.error());
  auto impl = std::make_unique<Impl>(options, *endpoint, std::move(on_message), std::move(on_connect));
  impl->connect();
  impl->thread = std::jthread([raw = impl.get()] {
    const RealTime priority;
    raw->io.run();
  });
  return std::unique_ptr<IgtlClient>(new IgtlClient(std::move(impl)));
}

TrackerLinkStatus IgtlClient::status() const {
  const std::lock_guard lock(impl_->mutex);
  TrackerLinkStatus status = impl_->status;
  if (impl_->connection) add_counters(status.counters, impl_->connection->counters());
  return status;
}

void IgtlClient::send(const IgtlMessage& message) {
  asio::post(impl_->io, [impl = impl_.get(), bytes = std::make_shared<std::string>(encode(message))] {
    if (impl->connection) impl->connection->send(bytes);
  });
}

void IgtlClient::stop() {
  impl_->io.stop();
  if (impl_->thread.joinable()) impl_->thread.join();
}

}  // namespace helicarm::tracker
