// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/serve.h"

#include <array>
#include <memory>

#include <asio/co_spawn.hpp>
#include <asio/detached.hpp>
#include <asio/experimental/awaitable_operators.hpp>
#include <asio/post.hpp>
#include <asio/read.hpp>
#include <asio/redirect_error.hpp>
#include <asio/ssl/stream.hpp>
#include <asio/steady_timer.hpp>
#include <asio/use_awaitable.hpp>
#include <asio/write.hpp>
#include <fmt/format.h>

namespace helicarm::receiver {
namespace {

using asio::awaitable;
using asio::use_awaitable;
using asio::ip::tcp;
using Clock = Admission::Clock;

/// Deadline of a connection; a connection to be replaced is ended through it from any thread.
struct Deadline {
  explicit Deadline(const tcp::socket::executor_type& executor) : timer(executor) {}

  asio::steady_timer timer;
  Clock::time_point until = Clock::time_point::max();
  bool evicted = false;
};

std::function<void()> eviction(const std::shared_ptr<Deadline>& deadline) {
  return [weak = std::weak_ptr(deadline), executor = deadline->timer.get_executor()] {
    asio::post(executor, [weak] {
      const auto held = weak.lock();
      if (!held) return;
      held->evicted = true;
      held->timer.cancel();
    });
  };
}

/// Limits the log to failures without an image: they can come in floods.
void notify(ReceiverShared& shared, Failure why) {
  const auto left_out = shared.lines.pass();
  if (!left_out) return;
  if (*left_out > 0) why.message += fmt::format(" ({} lines omitted)", *left_out);
  shared.hooks.cut(why);
}

template <class Stream>
constexpr bool is_tls = requires(Stream& stream) {
  stream.async_handshake(Stream::server, use_awaitable);
};

template <class Stream>
class Session {
 public:
  Session(Stream stream, ReceiverShared& shared, std::shared_ptr<Deadline> deadline, std::string address,
          Admission::Id id)
      : stream_(std::move(stream)),
        shared_(shared),
        deadline_(std::move(deadline)),
        id_(id),
        association_(shared, std::move(address), id) {}
  ~Session() {
    shared_.admission.leave(id_);
    if (!ended_) end({Reason::interrupted, "the receiver is closing"});
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  awaitable<void> run() {
    using namespace asio::experimental::awaitable_operators;
    const auto first = co_await (converse() || watch());
    if (first.index() == 0) co_return;
    ++(deadline_->evicted ? shared_.counters.evicted : shared_.counters.timed_out);
    end({Reason::not_connected, deadline_->evicted ? "replaced by another peer" : limit_});
  }

 private:
  /// Always ends by itself: `watch` is cancelled only when it ends.
  awaitable<void> converse() {
    std::optional<Breach> breach;
    try {
      allow(shared_.options.request_limit_s, "no association in time");
      if constexpr (is_tls<Stream>) co_await shake_hands();
      while (!association_.over()) {
        const std::string answer = co_await take_pdu();
        if (!answer.empty()) co_await asio::async_write(stream_, asio::buffer(answer), use_awaitable);
      }
      if (association_.aborted_by_peer())
        break_off({Reason::not_connected, "aborted by the peer"});
      else if (association_.image_on_the_way())
        break_off({Reason::not_connected, "released"});
      ended_ = true;
    } catch (const Breach& caught) {
      breach = caught;
    } catch (const BadInput& refused) {
      break_off(refused.failure());
    } catch (const asio::system_error& error) {
      // Cancelled by `watch`, which ends with the reason; else the connection failed.
      if (error.code() != asio::error::operation_aborted)
        break_off({Reason::not_connected, error.code().message()});
    } catch (const std::exception&) {
      break_off({Reason::not_connected, "out of memory"});
    }
    if (!breach) co_return;
    break_off({Reason::bad_value, breach->why});
    asio::error_code nobody_listens;
    const std::string abort = dicom::abort(breach->reason);
    co_await asio::async_write(stream_, asio::buffer(abort),
                               asio::redirect_error(use_awaitable, nobody_listens));
  }

  awaitable<void> shake_hands() {
    std::string certificate_error;
    stream_.set_verify_callback([&](bool good, asio::ssl::verify_context& context) {
      if (!good)
        certificate_error = X509_verify_cert_error_string(X509_STORE_CTX_get_error(context.native_handle()));
      return good;
    });
    asio::error_code error;
    co_await stream_.async_handshake(Stream::server, asio::redirect_error(use_awaitable, error));
    if (error == asio::error::operation_aborted) throw asio::system_error(error);
    heard_ = true;
    if (error)
      throw BadInput(Reason::not_connected,
                     "TLS handshake: " +
                         (certificate_error.empty() ? error.message() : "certificate: " + certificate_error));
  }

  awaitable<std::string> take_pdu() {
    limit_next_pdu();
    std::array<char, dicom::pdu_header_bytes> header;
    asio::error_code error;
    const std::size_t size =
        co_await asio::async_read(stream_, asio::buffer(header), asio::redirect_error(use_awaitable, error));
    heard_ = heard_ || size > 0;
    if (error) throw asio::system_error(error);
    const auto [type, length] = dicom::read_pdu_header({header.data(), header.size()});
    if (type < 1 || type > 7)
      throw Breach{dicom::AbortReason::unknown_pdu, fmt::format("unknown PDU of type {}", type)};
    if (length > association_.most_pdu_bytes())
      throw Breach{dicom::AbortReason::bad_value,
                   fmt::format("PDU of {} bytes, limit {}", length, association_.most_pdu_bytes())};
    std::string body(length, '\0');
    co_await asio::async_read(stream_, asio::buffer(body), use_awaitable);
    co_return association_.take(type, body);
  }

  /// The earliest of the limits for inactivity, message duration and time without an image.
  void limit_next_pdu() {
    if (!association_.associated()) return;
    const ReceiverOptions& options = shared_.options;
    const Clock::time_point now = Clock::now();
    if (!image_since_ || images_ != association_.images()) image_since_ = now;
    if (message_ != association_.message_on_the_way()) message_since_ = now;
    images_ = association_.images();
    message_ = association_.message_on_the_way();
    allow(options.idle_limit_s, "inactive for too long");
    if (message_ != 0)
      shorten(message_since_, options.object_limit_s, "message takes too long");
    else
      shorten(*image_since_, options.echo_limit_s, "no image for too long");
    if (deadline_->until < deadline_->timer.expiry()) deadline_->timer.cancel();  // `watch` re-evaluates it
  }

  static Clock::duration duration(double seconds) {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  }
  void allow(double seconds, const char* limit) {
    deadline_->until = Clock::now() + duration(seconds);
    limit_ = limit;
  }
  void shorten(Clock::time_point since, double seconds, const char* limit) {
    if (since + duration(seconds) >= deadline_->until) return;
    deadline_->until = since + duration(seconds);
    limit_ = limit;
  }

  awaitable<void> watch() {
    while (!deadline_->evicted && Clock::now() < deadline_->until) {
      deadline_->timer.expires_at(deadline_->until);
      asio::error_code ignored;
      co_await deadline_->timer.async_wait(asio::redirect_error(use_awaitable, ignored));
    }
  }

  void break_off(const Failure& why) {
    ++shared_.counters.aborted;
    // A connection without data only probes the port.
    if (heard_) end(why);
    ended_ = true;
  }

  /// For the log: every incomplete image, and other ends up to the line limit.
  void end(Failure why) {
    ended_ = true;
    const std::string peer = association_.peer();
    if (const auto bytes = association_.image_on_the_way())
      return shared_.hooks.cut({Reason::truncated, fmt::format("{}: image truncated after {} bytes: {}", peer,
                                                               *bytes, why.message)});
    why.message = fmt::format("{}: {} ended: {}", peer,
                              association_.associated() ? "association" : "connection", why.message);
    notify(shared_, std::move(why));
  }

  Stream stream_;
  ReceiverShared& shared_;
  std::shared_ptr<Deadline> deadline_;
  const Admission::Id id_;
  Association association_;
  bool heard_ = false;      ///< the peer has sent data
  bool ended_ = false;      ///< and was logged
  const char* limit_ = "";  ///< the limit that set the deadline
  std::optional<Clock::time_point> image_since_;
  Clock::time_point message_since_;
  std::uint64_t images_ = 0, message_ = 0;
};

template <class Stream>
awaitable<void> run_session(Stream stream, ReceiverShared& shared, std::shared_ptr<Deadline> deadline,
                            std::string address, Admission::Id id) {
  Session session(std::move(stream), shared, std::move(deadline), std::move(address), id);
  co_await session.run();
}

}  // namespace

void serve(tcp::socket socket, asio::ssl::context* tls, ReceiverShared& shared) {
  asio::error_code gone;
  const std::string address = socket.remote_endpoint(gone).address().to_string();
  if (gone) return;
  const auto executor = socket.get_executor();
  const auto deadline = std::make_shared<Deadline>(executor);
  const auto id = shared.admission.connect(address, eviction(deadline), Clock::now());
  if (!id) {
    ++shared.counters.turned_away;
    return notify(shared, {Reason::not_connected, address + ": rejected: too many connections"});
  }
  if (tls)
    asio::co_spawn(
        executor,
        run_session(asio::ssl::stream<tcp::socket>(std::move(socket), *tls), shared, deadline, address, *id),
        asio::detached);
  else
    asio::co_spawn(executor, run_session(std::move(socket), shared, deadline, address, *id), asio::detached);
}

}  // namespace helicarm::receiver
