// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/association.h"

#include <tuple>

#include <fmt/format.h>

#include "helicarm/xray/dicom_check.h"
#include "helicarm/xray/dicom_tags.h"

namespace helicarm::receiver {
namespace {

using dicom::AbortReason, dicom::Operation, dicom::PduType, dicom::Status;

constexpr std::size_t most_request_bytes = std::size_t{256} << 10;
constexpr std::size_t most_command_bytes = std::size_t{64} << 10;
constexpr std::size_t most_commitment_bytes = std::size_t{1} << 20;
// Bounds what remote peers can write into a log.
constexpr unsigned max_lines_per_s = 20;

template <class T>
T or_breach(Expected<T>&& value) {
  if (!value) throw Breach{AbortReason::bad_value, value.error().message};
  return *std::move(value);
}

AdmissionLimits limits_of(const ReceiverOptions& options) {
  AdmissionLimits limits;
  limits.associations = options.most_associations;
  limits.of_address = options.most_of_address;
  limits.spared_s = options.spared_s;
  return limits;
}

}  // namespace

ReceiverShared::ReceiverShared(const ReceiverOptions& receiver_options, Inbox& into, ReceiverHooks told)
    : options(receiver_options),
      inbox(into),
      hooks(std::move(told)),
      admission(limits_of(receiver_options)),
      lines(max_lines_per_s) {}

Association::Association(ReceiverShared& shared, std::string origin, Admission::Id id)
    : shared_(shared), origin_(std::move(origin)), id_(id) {}

std::string Association::peer() const {
  return title_.empty() ? origin_ : fmt::format("\"{}\" ({})", title_, origin_);
}

std::optional<std::size_t> Association::image_on_the_way() const {
  if (!command_ || !command_->is(Operation::store)) return std::nullopt;
  return bytes_.size();
}

std::size_t Association::most_pdu_bytes() const {
  return associated_ ? shared_.options.negotiation.most_pdu_bytes : most_request_bytes;
}

std::string Association::take(std::uint8_t type, std::string_view body) {
  const auto is = [&](PduType wanted) { return type == static_cast<std::uint8_t>(wanted); };
  const auto unexpected = [&] {
    return Breach{AbortReason::unexpected_pdu, fmt::format("unexpected PDU of type {}", type)};
  };
  if (over_) throw unexpected();
  if (is(PduType::abort)) {
    over_ = aborted_by_peer_ = true;
    return {};
  }
  if (!associated_) {
    if (!is(PduType::associate_request)) throw unexpected();
    return associate(body);
  }
  if (is(PduType::release_request)) {
    over_ = true;
    return dicom::release_answer();
  }
  if (!is(PduType::data)) throw unexpected();
  return take_data(body);
}

std::string Association::associate(std::string_view body) {
  const dicom::AssociationRequest request = or_breach(dicom::read_association_request(body));
  constexpr dicom::Rejection local_limit_exceeded{2, 3, 2};
  auto answers = dicom::negotiate(request, shared_.options.negotiation);
  if (answers && !shared_.admission.associate(id_, Admission::Clock::now()))
    answers = tl::unexpected(local_limit_exceeded);
  title_ = request.calling;
  peer_pdu_bytes_ = request.most_pdu_bytes;
  if (!answers) {
    ++shared_.counters.rejected;
    const dicom::Rejection why = answers.error();
    shared_.hooks.refused(
        {Reason::bad_value, fmt::format("association of {} with \"{}\" rejected ({} {} {})", peer(),
                                        request.called, why.result, why.source, why.reason)});
    over_ = true;
    return dicom::associate_reject(why);
  }
  for (const dicom::ContextAnswer& answer : *answers)
    if (answer.result == dicom::ContextResult::accepted) contexts_[answer.id] = answer;
  associated_ = true;
  ++shared_.counters.associations;
  return dicom::associate_accept(request, *answers, shared_.options.negotiation.most_pdu_bytes);
}

std::string Association::take_data(std::string_view body) {
  std::string sent;
  for (const dicom::Fragment& fragment : or_breach(dicom::read_fragments(body)))
    sent += take_fragment(fragment);
  return sent;
}

std::string Association::take_fragment(const dicom::Fragment& fragment) {
  const auto context = contexts_.find(fragment.context);
  if (context == contexts_.end() || fragment.command == command_.has_value() ||
      (command_ && fragment.context != context_))
    throw Breach{AbortReason::bad_value,
                 fmt::format("unexpected fragment of {} in context {}",
                             fragment.command ? "a command" : "data", fragment.context)};
  if (!std::exchange(message_on_the_way_, true)) ++messages_;
  context_ = fragment.context;
  if (!fragment.command)
    take_memory(fragment.bytes.size());
  else if (bytes_.size() + fragment.bytes.size() > most_command_bytes)
    throw Breach{AbortReason::unspecified, fmt::format("command over {} bytes", most_command_bytes)};
  if (command_ && command_->is(Operation::action) && memory_taken_ > most_commitment_bytes)
    throw Breach{AbortReason::unspecified,
                 fmt::format("storage commitment over {} bytes", most_commitment_bytes)};
  bytes_ += fragment.bytes;
  if (!fragment.last) return {};
  if (fragment.command) {
    command_ = or_breach(dicom::read_command(bytes_));
    bytes_.clear();
    if (command_->is(Operation::store)) shared_.admission.image_begins(id_);
    if (command_->data_set_follows) return {};
  }
  std::string sent = answer(context->second);
  if (command_->is(Operation::store)) shared_.admission.image_ends(id_, Admission::Clock::now());
  command_.reset();
  message_on_the_way_ = false;
  bytes_ = {};
  release_memory();
  return sent;
}

std::string Association::answer(const dicom::ContextAnswer& context) {
  if (command_->is(Operation::cancel) || command_->is(Operation::event_report_response)) return {};
  if (command_->is(Operation::action)) return commit(context);
  Status status = Status::operation_unknown;
  std::string comment;
  if (command_->is(Operation::echo)) {
    ++shared_.counters.echoed;
    status = Status::success;
  } else if (command_->is(Operation::store)) {
    ++images_;
    std::tie(status, comment) = store(context);
  }
  return dicom::command_data(context_, dicom::write_response(*command_, status, comment));
}

std::string Association::commit(const dicom::ContextAnswer& context) {
  const auto respond = [&](Status status, std::string_view comment = {}) {
    return dicom::command_data(context_, dicom::write_response(*command_, status, comment));
  };
  if (context.abstract_syntax != commitment_class || command_->sop_class != commitment_class)
    return respond(Status::no_such_class);
  if (command_->sop_instance != commitment_instance) return respond(Status::no_such_instance);
  if (command_->action_type != 1) return respond(Status::no_such_action);
  const auto request = read_commitment_request(bytes_);
  if (!request) return respond(Status::invalid_argument, request.error().message);
  CommitmentReport report = receiver::commit(*request, shared_.inbox);
  shared_.counters.commitments += report.failed.empty();
  const std::uint16_t event = report.event();
  for (const ReportPeer& peer : shared_.options.report_peers)
    if (peer.title == title_)
      return respond(shared_.send_report(peer, std::move(report)) ? Status::success
                                                                  : Status::resource_limitation);
  return respond(Status::success) +
         dicom::command_data(context_, dicom::write_event_report({1, std::string(commitment_class),
                                                                  std::string(commitment_instance), event})) +
         dicom::data_set_data(context_, write_commitment_report(report), peer_pdu_bytes_);
}

std::pair<Status, std::string> Association::store(const dicom::ContextAnswer& context) {
  const auto refuse = [&](Status status, const Failure& failure) {
    ++shared_.counters.refused;
    shared_.hooks.refused(failure);
    return std::pair{status, std::string(code(failure.reason)) + ": " + failure.message};
  };
  const std::string origin = "image from " + title_;
  if (!xray::is_xray_class(command_->sop_class) || command_->sop_class != context.abstract_syntax)
    return refuse(Status::sop_class_unknown,
                  {Reason::unsupported, origin + ": SOP class was not negotiated"});
  const std::string file =
      dicom_file(command_->sop_class, command_->sop_instance, context.transfer_syntax, bytes_);
  const auto elements = xray::walk_dicom(file, origin);
  if (!elements) return refuse(Status::cannot_understand, elements.error());
  if (elements->text(xray::tags::sop_instance) != command_->sop_instance ||
      elements->text(xray::tags::sop_class) != command_->sop_class)
    return refuse(Status::data_set_does_not_match,
                  {Reason::bad_value, origin + ": UIDs of data set and command differ"});
  const auto arrival = shared_.inbox.store(file, origin);
  if (!arrival)
    return refuse(
        arrival.error().reason == Reason::cannot_write ? Status::out_of_resources : Status::cannot_understand,
        arrival.error());
  ++(arrival->repeated ? shared_.counters.repeated : shared_.counters.stored);
  shared_.hooks.arrived(*arrival);
  return {Status::success, {}};
}

void Association::take_memory(std::size_t bytes) {
  const ReceiverOptions& options = shared_.options;
  memory_taken_ += bytes;
  const std::size_t all = shared_.counters.bytes_on_the_way += bytes;
  if (memory_taken_ > options.most_object_bytes)
    throw Breach{AbortReason::unspecified, fmt::format("image over {} bytes", options.most_object_bytes)};
  if (all > options.most_bytes)
    throw Breach{AbortReason::unspecified,
                 fmt::format("images being received exceed {} bytes in total", options.most_bytes)};
}

void Association::release_memory() { shared_.counters.bytes_on_the_way -= std::exchange(memory_taken_, 0); }

}  // namespace helicarm::receiver
