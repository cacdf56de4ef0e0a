// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/commitment.h"

#include <charconv>
#include <optional>

#include <asio/ip/address.hpp>
#include <fmt/format.h>

#include "helicarm/core/text.h"
#include "helicarm/devices/receiver/dimse.h"
#include "helicarm/devices/receiver/pdu.h"
#include "helicarm/xray/dicom_elements.h"

namespace helicarm::receiver {
namespace {

constexpr xray::DicomTag transaction_uid{0x00081195, "Transaction UID"};
constexpr xray::DicomTag referenced_sequence{0x00081199, "Referenced SOP Sequence"};
constexpr xray::DicomTag referenced_class{0x00081150, "Referenced SOP Class UID"};
constexpr xray::DicomTag referenced_instance{0x00081155, "Referenced SOP Instance UID"};
constexpr std::uint32_t failed_sequence = 0x00081198, failure_reason = 0x00081197, item_tag = 0xFFFEE000;

std::string uid_of(const xray::DicomElements& of, xray::DicomTag tag) {
  const std::string_view uid = of.text(tag);
  if (!dicom::is_uid(uid)) of.refuse(Reason::bad_value, tag, "is missing or not a valid UID");
  return std::string(uid);
}

std::string reference_item(const Reference& reference, const std::string& more = {}) {
  return dicom::element(item_tag, dicom::element(referenced_class.number, reference.sop_class) +
                                      dicom::element(referenced_instance.number, reference.sop_instance) +
                                      more);
}

}  // namespace

Expected<CommitmentRequest> read_commitment_request(std::string_view data_set) {
  return guarded([&] {
    const std::string file =
        dicom_file(commitment_class, commitment_instance, dicom::implicit_little_endian, data_set);
    const auto elements = value_or_throw(xray::walk_dicom(file, "storage commitment"));
    CommitmentRequest request{uid_of(elements, transaction_uid), {}};
    for (const xray::DicomElements& item : xray::sequence_items(elements, referenced_sequence)) {
      if (request.references.size() == most_references)
        elements.refuse(Reason::bad_value, referenced_sequence,
                        fmt::format("has more than {} items", most_references));
      request.references.push_back({uid_of(item, referenced_class), uid_of(item, referenced_instance)});
    }
    if (request.references.empty())
      elements.refuse(Reason::bad_value, referenced_sequence, "is missing or empty");
    return request;
  });
}

CommitmentReport commit(const CommitmentRequest& request, const Inbox& inbox) {
  CommitmentReport report{request.transaction, {}, {}};
  for (const Reference& reference : request.references) {
    const auto stored = inbox.class_of(reference.sop_instance);
    std::optional<CommitmentFailure> failure;
    if (!stored)
      failure = stored.error().reason == Reason::missing_file ? CommitmentFailure::no_such_instance
                                                              : CommitmentFailure::processing_failure;
    else if (*stored != reference.sop_class)
      failure = CommitmentFailure::class_instance_conflict;
    if (failure)
      report.failed.push_back({reference, *failure});
    else
      report.committed.push_back(reference);
  }
  return report;
}

std::string write_commitment_report(const CommitmentReport& report) {
  std::string failed;
  for (const auto& [reference, reason] : report.failed)
    failed += reference_item(
        reference,
        dicom::element(failure_reason, dicom::little_endian(static_cast<std::uint16_t>(reason), 2)));
  std::string committed;
  for (const Reference& reference : report.committed) committed += reference_item(reference);
  return dicom::element(transaction_uid.number, report.transaction) +
         (failed.empty() ? "" : dicom::element(failed_sequence, failed)) +
         (committed.empty() ? "" : dicom::element(referenced_sequence.number, committed));
}

Expected<ReportPeer> read_report_peer(std::string_view text) {
  const auto equals = text.find('=');
  const auto colon = text.rfind(':');
  ReportPeer peer;
  asio::error_code error;
  bool good = equals != std::string_view::npos && colon != std::string_view::npos && equals < colon;
  if (good) {
    peer.title = text.substr(0, equals);
    peer.address = text.substr(equals + 1, colon - equals - 1);
    const auto [end, wrong] = std::from_chars(text.data() + colon + 1, text.data() + text.size(), peer.port);
    asio::ip::make_address(peer.address, error);
    good = wrong == std::errc() && end == text.data() + text.size() && peer.port > 0 && !error &&
           dicom::is_title(peer.title);
  }
  if (!good)
    return fail(Reason::usage,
                fmt::format("\"{}\": is not TITLE=ADDRESS:PORT with a title of 1 to 16 characters, a numeric "
                            "address and a port from 1 to 65535",
                            without_control_characters(std::string(text))));
  return peer;
}

}  // namespace helicarm::receiver
