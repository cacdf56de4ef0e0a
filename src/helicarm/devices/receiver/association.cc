// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/association.h"

#include <array>

#include <asio/experimental/awaitable_operators.hpp>
#include <asio/read.hpp>
#include <asio/ssl/stream.hpp>
#include <asio/steady_timer.hpp>
#include <asio/use_awaitable.hpp>
#include <asio/write.hpp>
#include <fmt/format.h>

#include "helicarm/devices/receiver/dimse.h"
#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/dicom_tags.h"

namespace helicarm {
namespace {

using asio::awaitable;
using asio::use_awaitable;
using dicom::AbortReason;
using Clock = std::chrono::steady_clock;

constexpr std::size_t most_request_bytes = std::size_t{256} << 10;
constexpr std::size_t most_command_bytes = std::size_t{64} << 10;

/// The peer broke the protocol.
struct Breach {
  AbortReason reason;
};

template <class T>
T or_breach(Expected<T> value) {
  if (!value) throw Breach{AbortReason::bad_value};
  return *std::move(value);
}

struct Pdu {
  std::uint8_t type;
  std::string body;

  bool is(dicom::PduType wanted) const { return type == static_cast<std::uint8_t>(wanted); }
};

/// A part of the memory that all pictures on the way may take.
class Share {
 public:
  explicit Share(ReceiverShared& shared) : shared_(shared) {}
  ~Share() { release(); }
  Share(const Share&) = delete;
  Share& operator=(const Share&) = delete;

  bool grow(std::size_t bytes) {
    taken_ += bytes;
    return (shared_.bytes_taken += bytes) <= shared_.options.most_bytes &&
           taken_ <= shared_.options.most_object_bytes;
  }
  void release() { shared_.bytes_taken -= std::exchange(taken_, 0); }

 private:
  ReceiverShared& shared_;
  std::size_t taken_ = 0;
};

template <class Stream>
class Association {
 public:
  Association(Stream stream, ReceiverShared& shared)
      : stream_(std::move(stream)), shared_(shared), share_(shared) {
    allow(shared.options.request_limit_s);
  }
  ~Association() {
    if (counted_) --shared_.associated;
  }
  Association(const Association&) = delete;
  Association& operator=(const Association&) = delete;

  awaitable<void> run() {
    using namespace asio::experimental::awaitable_operators;
    const auto first = co_await (converse() || watch());
    if (first.index() == 1) ++shared_.counters.timed_out;
  }

 private:
  /// Ends by itself in every case: `watch` is cancelled by its end only.
  awaitable<void> converse() {
    std::optional<Breach> breach;
    try {
      if constexpr (requires { stream_.async_handshake(Stream::server, use_awaitable); })
        co_await stream_.async_handshake(Stream::server, use_awaitable);
      if (co_await associate()) co_await exchange();
    } catch (const Breach& caught) {
      breach = caught;
    } catch (const std::exception&) {
      ++shared_.counters.aborted;  // the connection broke
    }
    if (!breach) co_return;
    ++shared_.counters.aborted;
    try {
      co_await send(dicom::abort(breach->reason));
    } catch (const std::exception&) {
      // nobody is there to be told
    }
  }

  awaitable<void> watch() {
    asio::steady_timer timer(co_await asio::this_coro::executor);
    while (Clock::now() < deadline_) {
      timer.expires_at(deadline_);
      co_await timer.async_wait(use_awaitable);
    }
  }

  void allow(double seconds) {
    deadline_ =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  }

  awaitable<Pdu> read_pdu(std::size_t most) {
    std::array<char, dicom::pdu_header_bytes> header;
    co_await asio::async_read(stream_, asio::buffer(header), use_awaitable);
    const auto [type, length] = dicom::read_pdu_header({header.data(), header.size()});
    if (type < 1 || type > 7) throw Breach{AbortReason::unknown_pdu};
    if (length > most) throw Breach{AbortReason::bad_value};
    Pdu pdu{type, std::string(length, '\0')};
    co_await asio::async_read(stream_, asio::buffer(pdu.body), use_awaitable);
    co_return pdu;
  }

  awaitable<void> send(const std::string& bytes) {
    co_await asio::async_write(stream_, asio::buffer(bytes), use_awaitable);
  }

  /// Whether there is an association now.
  awaitable<bool> associate() {
    const Pdu pdu = co_await read_pdu(most_request_bytes);
    if (!pdu.is(dicom::PduType::associate_request)) throw Breach{AbortReason::unexpected_pdu};
    const dicom::AssociationRequest request = or_breach(dicom::read_association_request(pdu.body));
    constexpr dicom::Rejection local_limit_exceeded{2, 3, 2};
    auto answers = dicom::negotiate(request, shared_.options.negotiation);
    counted_ = answers && ++shared_.associated <= shared_.options.most_associations;
    if (answers && !counted_) {
      --shared_.associated;
      answers = tl::unexpected(local_limit_exceeded);
    }
    if (!answers) {
      ++shared_.counters.rejected;
      shared_.hooks.refused(
          {Reason::bad_value, fmt::format("association of \"{}\" with \"{}\" rejected ({} {} {})",
                                          request.calling, request.called, answers.error().result,
                                          answers.error().source, answers.error().reason)});
      co_await send(dicom::associate_reject(answers.error()));
      co_return false;
    }
    for (const dicom::ContextAnswer& answer : *answers)
      if (answer.result == dicom::ContextResult::accepted) contexts_[answer.id] = answer;
    peer_ = request.calling;
    ++shared_.counters.associations;
    co_await send(dicom::associate_accept(request, *answers, shared_.options.negotiation.most_pdu_bytes));
    co_return true;
  }

  awaitable<void> exchange() {
    while (true) {
      allow(std::min(shared_.options.idle_limit_s,
                     std::chrono::duration<double>(message_deadline() - Clock::now()).count()));
      const Pdu pdu = co_await read_pdu(shared_.options.negotiation.most_pdu_bytes);
      if (pdu.is(dicom::PduType::release_request)) {
        co_await send(dicom::release_answer());
        co_return;
      }
      if (pdu.is(dicom::PduType::abort)) {
        ++shared_.counters.aborted;
        co_return;
      }
      if (!pdu.is(dicom::PduType::data)) throw Breach{AbortReason::unexpected_pdu};
      for (const dicom::Fragment& fragment : or_breach(dicom::read_fragments(pdu.body)))
        co_await take(fragment);
    }
  }

  Clock::time_point message_deadline() const {
    return message_began_
               ? *message_began_ + std::chrono::duration_cast<Clock::duration>(
                                       std::chrono::duration<double>(shared_.options.object_limit_s))
               : Clock::time_point::max();
  }

  awaitable<void> take(const dicom::Fragment& fragment) {
    const auto context = contexts_.find(fragment.context);
    if (context == contexts_.end() || fragment.command == command_.has_value() ||
        (command_ && fragment.context != context_))
      throw Breach{AbortReason::bad_value};
    if (!message_began_) message_began_ = Clock::now();
    context_ = fragment.context;
    if (fragment.command ? bytes_.size() + fragment.bytes.size() > most_command_bytes
                         : !share_.grow(fragment.bytes.size()))
      throw Breach{AbortReason::unspecified};
    bytes_ += fragment.bytes;
    if (!fragment.last) co_return;
    if (fragment.command) {
      command_ = or_breach(dicom::read_command(bytes_));
      bytes_.clear();
      if (command_->data_set_follows) co_return;
    }
    co_await answer(context->second);
    command_.reset();
    message_began_.reset();
    bytes_ = {};
    share_.release();
  }

  awaitable<void> answer(const dicom::ContextAnswer& context) {
    using dicom::Operation, dicom::Status;
    if (command_->is(Operation::cancel)) co_return;
    Status status = Status::operation_unknown;
    std::string comment;
    if (command_->is(Operation::echo)) {
      ++shared_.counters.echoed;
      status = Status::success;
    } else if (command_->is(Operation::store)) {
      std::tie(status, comment) = store(context);
    }
    co_await send(dicom::command_data(context_, dicom::write_response(*command_, status, comment)));
  }

  std::pair<dicom::Status, std::string> store(const dicom::ContextAnswer& context) {
    using dicom::Status;
    const auto refuse = [&](Status status, Failure failure) {
      ++shared_.counters.refused;
      shared_.hooks.refused(failure);
      return std::pair{status, std::string(code(failure.reason)) + ": " + failure.message};
    };
    const std::string origin = "picture from " + peer_;
    if (!is_xray_class(command_->sop_class) || command_->sop_class != context.abstract_syntax)
      return refuse(Status::sop_class_unknown,
                    {Reason::unsupported, origin + ": SOP class was not agreed on"});
    const std::string file =
        dicom_file(command_->sop_class, command_->sop_instance, context.transfer_syntax, bytes_);
    const auto elements = walk_dicom(file, origin);
    if (!elements) return refuse(Status::cannot_understand, elements.error());
    if (elements->text(tags::sop_instance) != command_->sop_instance ||
        elements->text(tags::sop_class) != command_->sop_class)
      return refuse(Status::data_set_does_not_match,
                    {Reason::bad_value, origin + ": UIDs of data set and command differ"});
    const auto arrival = shared_.inbox.store(file, origin);
    if (!arrival)
      return refuse(arrival.error().reason == Reason::cannot_write ? Status::out_of_resources
                                                                   : Status::cannot_understand,
                    arrival.error());
    ++(arrival->repeated ? shared_.counters.repeated : shared_.counters.stored);
    shared_.hooks.arrived(*arrival);
    return {Status::success, {}};
  }

  Stream stream_;
  ReceiverShared& shared_;
  Share share_;
  bool counted_ = false;  ///< among the associations
  Clock::time_point deadline_;
  std::string peer_;
  std::map<std::uint8_t, dicom::ContextAnswer> contexts_;
  // The message that is on the way.
  std::optional<Clock::time_point> message_began_;
  std::uint8_t context_ = 0;
  std::optional<dicom::Command> command_;
  std::string bytes_;
};

}  // namespace

awaitable<void> serve(asio::ip::tcp::socket socket, asio::ssl::context* tls, ReceiverShared& shared) {
  ++shared.open;
  try {
    if (tls) {
      Association association(asio::ssl::stream<asio::ip::tcp::socket>(std::move(socket), *tls), shared);
      co_await association.run();
    } else {
      Association association(std::move(socket), shared);
      co_await association.run();
    }
  } catch (const std::exception&) {
    ++shared.counters.aborted;
  }
  --shared.open;
}

}  // namespace helicarm
