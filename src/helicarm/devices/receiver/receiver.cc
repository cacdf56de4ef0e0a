// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/receiver.h"

#include <chrono>
#include <thread>

#include <asio/co_spawn.hpp>
#include <asio/detached.hpp>
#include <asio/redirect_error.hpp>
#include <asio/steady_timer.hpp>
#include <asio/strand.hpp>
#include <asio/thread_pool.hpp>
#include <asio/use_awaitable.hpp>
#include <fmt/format.h>

#include "helicarm/devices/receiver/send_report.h"
#include "helicarm/devices/receiver/serve.h"

namespace helicarm::receiver {
namespace {

using asio::ip::tcp;

// Checking and storing an image occupies a thread for some milliseconds.
constexpr std::size_t thread_count = 4;
constexpr unsigned most_reports = 32;
// Without file descriptors an immediate retry would use a whole core.
constexpr std::chrono::milliseconds retry_delay{100};

asio::ssl::context tls_context(const TlsFiles& files) {
  asio::ssl::context context(asio::ssl::context::tls);
  const auto use = [](const char* what, const std::filesystem::path& file, auto&& load) {
    asio::error_code error;
    load(error);
    if (error)
      throw BadInput(Reason::bad_value, fmt::format("{} {}: {}", what, file.string(), error.message()));
  };
  context.set_options(asio::ssl::context::default_workarounds | asio::ssl::context::no_tlsv1 |
                      asio::ssl::context::no_tlsv1_1);
  context.set_verify_mode(asio::ssl::verify_peer | asio::ssl::verify_fail_if_no_peer_cert);
  use("certificate", files.certificate,
      [&](auto& e) { context.use_certificate_chain_file(files.certificate.string(), e); });
  use("key", files.key,
      [&](auto& e) { context.use_private_key_file(files.key.string(), asio::ssl::context::pem, e); });
  use("authorities", files.authorities,
      [&](auto& e) { context.load_verify_file(files.authorities.string(), e); });
  return context;
}

}  // namespace

struct DicomReceiver::Engine {
  ReceiverShared shared;
  std::optional<asio::ssl::context> tls;
  asio::thread_pool pool{thread_count};
  tcp::acceptor acceptor{pool};

  Engine(const ReceiverOptions& options, Inbox& inbox, ReceiverHooks hooks)
      : shared(options, inbox, std::move(hooks)) {
    shared.send_report = [this](const ReportPeer& peer, CommitmentReport report) {
      return send_report(peer, std::move(report));
    };
  }
  ~Engine() {
    pool.stop();
    pool.join();
  }

  void listen() {
    asio::error_code error;
    const ReceiverOptions& options = shared.options;
    const auto address = asio::ip::make_address(options.address, error);
    if (error)
      throw BadInput(Reason::bad_value, fmt::format("address {}: is not an IP address", options.address));
    if (options.tls) tls = tls_context(*options.tls);
    const tcp::endpoint endpoint(address, options.port);
    acceptor.open(endpoint.protocol());
    acceptor.set_option(tcp::acceptor::reuse_address(true));
    acceptor.bind(endpoint, error);
    if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
    if (error)
      throw BadInput(Reason::port_taken,
                     fmt::format("{} port {}: {}", options.address, options.port, error.message()));
    asio::co_spawn(pool, accept(), asio::detached);
  }

  bool send_report(const ReportPeer& peer, CommitmentReport report) {
    if (++shared.counters.reports_on_the_way > most_reports) {
      --shared.counters.reports_on_the_way;
      return false;
    }
    asio::co_spawn(
        asio::make_strand(pool),
        receiver::send_report(peer, shared.options.negotiation.title, std::move(report),
                              tls ? &*tls : nullptr, shared.options.idle_limit_s),
        [this, peer](const std::exception_ptr&, const std::string& why) {
          --shared.counters.reports_on_the_way;
          if (why.empty())
            ++shared.counters.reported;
          else
            shared.hooks.cut({Reason::not_connected,
                              fmt::format("\"{}\" ({} port {}): storage commitment not reported: {}",
                                          peer.title, peer.address, peer.port, why)});
        });
    return true;
  }

  asio::awaitable<void> accept() {
    asio::steady_timer timer(pool);
    for (bool well = true;;) {
      tcp::socket socket(asio::make_strand(pool));
      asio::error_code error;
      co_await acceptor.async_accept(socket, asio::redirect_error(asio::use_awaitable, error));
      if (error == asio::error::operation_aborted) co_return;
      if (!error) {
        ++shared.counters.connections;
        serve(std::move(socket), tls ? &*tls : nullptr, shared);
        well = true;
        continue;
      }
      ++shared.counters.accept_failures;
      if (std::exchange(well, false))
        shared.hooks.cut({Reason::not_connected, "connections cannot be accepted: " + error.message()});
      timer.expires_after(retry_delay);
      co_await timer.async_wait(asio::use_awaitable);
    }
  }
};

DicomReceiver::DicomReceiver(std::unique_ptr<Engine> engine) : engine_(std::move(engine)) {}
DicomReceiver::~DicomReceiver() = default;

Expected<std::unique_ptr<DicomReceiver>> DicomReceiver::open(const ReceiverOptions& options, Inbox& inbox,
                                                             ReceiverHooks hooks) {
  return guarded([&] {
    auto engine = std::make_unique<Engine>(options, inbox, std::move(hooks));
    engine->listen();
    return std::unique_ptr<DicomReceiver>(new DicomReceiver(std::move(engine)));
  });
}

std::uint16_t DicomReceiver::port() const { return engine_->acceptor.local_endpoint().port(); }
std::uint64_t DicomReceiver::broken() const {
  const ReceiverCounters& counters = engine_->shared.counters;
  return counters.rejected + counters.aborted + counters.timed_out;
}
bool DicomReceiver::await_idle(std::chrono::milliseconds longest) {
  constexpr std::chrono::milliseconds step{5};
  const auto end = std::chrono::steady_clock::now() + longest;
  while (engine_->shared.admission.connected() > 0) {
    if (std::chrono::steady_clock::now() >= end) return false;
    std::this_thread::sleep_for(step);
  }
  return true;
}
const ReceiverCounters& DicomReceiver::counters() const { return engine_->shared.counters; }

}  // namespace helicarm::receiver
