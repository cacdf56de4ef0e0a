// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "helicarm/devices/tracker/igtl_message.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm::tracker {

/// Splits a connection's bytes into messages, independent of segmentation. A message that is invalid within
/// its announced length is dropped and counted: "messages", "wrong_crc", "unsupported_version", "malformed";
/// "unknown_type" counts among the messages.
class IgtlStream {
 public:
  using Sink = std::function<void(IgtlMessage&&)>;

  /// Limit of bodies, if below `body_limit` of their type.
  explicit IgtlStream(std::uint64_t most_body_bytes = std::uint64_t{64} << 20)
      : most_body_bytes_(most_body_bytes) {}

  /// Fails when message boundaries are lost and the connection must be closed: an invalid header, a body
  /// above its limit, or `max_wrong_crcs` consecutive wrong checksums.
  Expected<void> feed(std::string_view bytes, const Sink& sink);

  const Counters& counters() const { return counters_; }
  /// Bytes of an incomplete message.
  std::size_t held() const { return held_.size(); }
  /// Memory in use; that of a large message is released afterwards.
  std::size_t memory() const { return held_.capacity(); }

  /// One bit error damages one message; this many indicate a lost stream.
  static constexpr int max_wrong_crcs = 5;

 private:
  Expected<std::size_t> consume(std::string_view bytes, const Sink& sink);
  Expected<void> deliver(std::string_view body, const Sink& sink);

  std::uint64_t most_body_bytes_;
  std::string held_;
  std::optional<IgtlHeader> header_;
  int wrong_crcs_ = 0;
  Counters counters_;
};

}  // namespace helicarm::tracker
