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

namespace helicarm {

/// What all associations share.
struct ReceiverShared {
  ReceiverShared(const ReceiverOptions& given, Inbox& into, ReceiverHooks told);

  ReceiverOptions options;
  Inbox& inbox;
  ReceiverHooks hooks;
  ReceiverCounters counters;
  Admission admission;
  LineLimit lines;  ///< about peers that sent no image
};

/// The peer broke the protocol.
struct Breach {
  dicom::AbortReason reason;
  std::string why;
};

/// One association without its socket: protocol data units in, bytes to send out.
class Association {
 public:
  /// `origin` is the peer's address; `id` of its connection in the shared admission.
  Association(ReceiverShared& shared, std::string origin, Admission::Id id);
  ~Association() { release_memory(); }
  Association(const Association&) = delete;
  Association& operator=(const Association&) = delete;

  /// Longest body of the next PDU.
  std::size_t most_pdu_bytes() const;
  /// Takes a PDU's type and whole body; what to send back, perhaps nothing. Throws Breach. An image is in the
  /// inbox when this returns.
  std::string take(std::uint8_t type, std::string_view body);

  bool associated() const { return associated_; }
  /// Released, aborted by the peer or rejected: nothing more is to be read.
  bool over() const { return over_; }
  bool aborted_by_peer() const { return aborted_by_peer_; }
  /// Number, from 1, of the message that has begun and not ended; 0 where there is none.
  std::uint64_t message_on_the_way() const { return message_on_the_way_ ? messages_ : 0; }
  /// An image has begun, of which so many bytes are here.
  std::optional<std::size_t> image_on_the_way() const;
  /// Images that came whole, taken or refused.
  std::uint64_t images() const { return images_; }
  /// The peer, for a log: its title, if it gave one, and its address.
  std::string peer() const;

 private:
  std::string associate(std::string_view body);
  std::string take_data(std::string_view body);
  std::string take_fragment(const dicom::Fragment& fragment);
  std::string answer(const dicom::ContextAnswer& context);
  std::pair<dicom::Status, std::string> store(const dicom::ContextAnswer& context);
  void take_memory(std::size_t bytes);
  void release_memory();

  ReceiverShared& shared_;
  const std::string origin_;
  const Admission::Id id_;
  bool associated_ = false, over_ = false, aborted_by_peer_ = false;
  std::string title_;
  std::map<std::uint8_t, dicom::ContextAnswer> contexts_;
  std::uint64_t images_ = 0;
  std::uint64_t messages_ = 0;
  // The message that is on the way.
  bool message_on_the_way_ = false;
  std::uint8_t context_ = 0;
  std::optional<dicom::Command> command_;
  std::string bytes_;
  std::size_t memory_taken_ = 0;
};

}  // namespace helicarm
