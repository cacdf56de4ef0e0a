// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "helicarm/core/line_limit.h"
#include "helicarm/devices/receiver/admission.h"
#include "helicarm/devices/receiver/dimse.h"
#include "helicarm/devices/receiver/receiver.h"

namespace helicarm::receiver {

/// State shared by all associations.
struct ReceiverShared {
  ReceiverShared(const ReceiverOptions& receiver_options, Inbox& into, ReceiverHooks told);

  ReceiverOptions options;
  Inbox& inbox;
  ReceiverHooks hooks;
  ReceiverCounters counters;
  Admission admission;
  /// Reports to this peer on an association of its own; false if too many reports wait. Set by the receiver.
  std::function<bool(const ReportPeer&, CommitmentReport)> send_report;
  LineLimit lines;  ///< limits log lines about peers that sent no image
};

/// A protocol violation by the peer.
struct Breach {
  dicom::AbortReason reason;
  std::string why;
};

/// One association without its socket: protocol data units in, bytes to send out.
class Association {
 public:
  /// `origin` is the peer's address; `id` identifies its connection in the shared admission.
  Association(ReceiverShared& shared, std::string origin, Admission::Id id);
  ~Association() { release_memory(); }
  Association(const Association&) = delete;
  Association& operator=(const Association&) = delete;

  /// Largest allowed body of the next PDU.
  std::size_t most_pdu_bytes() const;
  /// Processes a PDU's type and whole body; returns the bytes to send, possibly none. Throws Breach. An image
  /// is in the inbox when this returns.
  std::string take(std::uint8_t type, std::string_view body);

  bool associated() const { return associated_; }
  /// Released, aborted by the peer or rejected: no more input is read.
  bool over() const { return over_; }
  bool aborted_by_peer() const { return aborted_by_peer_; }
  /// Number, from 1, of the message being received; 0 if there is none.
  std::uint64_t message_on_the_way() const { return message_on_the_way_ ? messages_ : 0; }
  /// Bytes received so far of the image being received.
  std::optional<std::size_t> image_on_the_way() const;
  /// Complete images, accepted or refused.
  std::uint64_t images() const { return images_; }
  /// The peer's title, if known, and address, for a log.
  std::string peer() const;

 private:
  std::string associate(std::string_view body);
  std::string take_data(std::string_view body);
  std::string take_fragment(const dicom::Fragment& fragment);
  std::string answer(const dicom::ContextAnswer& context);
  std::string commit(const dicom::ContextAnswer& context);
  std::pair<dicom::Status, std::string> store(const dicom::ContextAnswer& context);
  void take_memory(std::size_t bytes);
  void release_memory();

  ReceiverShared& shared_;
  const std::string origin_;
  const Admission::Id id_;
  bool associated_ = false, over_ = false, aborted_by_peer_ = false;
  std::string title_;
  std::uint32_t peer_pdu_bytes_ = 0;
  std::map<std::uint8_t, dicom::ContextAnswer> contexts_;
  std::uint64_t images_ = 0;
  std::uint64_t messages_ = 0;
  // The message being received.
  bool message_on_the_way_ = false;
  std::uint8_t context_ = 0;
  std::optional<dicom::Command> command_;
  std::string bytes_;
  std::size_t memory_taken_ = 0;
};

}  // namespace helicarm::receiver
