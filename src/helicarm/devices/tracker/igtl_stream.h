// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "helicarm/devices/tracker/igtl_message.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm {

/// Cuts a connection's bytes, however they are segmented, into messages. A message that is unsound within
/// its announced length is dropped and counted: "messages", "wrong_crc", "unsupported_version", "malformed";
/// "unknown_type" counts among the messages.
class IgtlStream {
 public:
  using Sink = std::function<void(IgtlMessage&&)>;

  /// Of bodies, where it is less than `body_limit` of their type.
  explicit IgtlStream(std::uint64_t most_body_bytes = std::uint64_t{64} << 20)
      : most_body_bytes_(most_body_bytes) {}

  /// Fails when the place of the next message is lost, so that the connection must be closed: what follows
  /// is no header, a body over its limit, or `max_wrong_crcs` wrong check sums in a row.
  Expected<void> feed(std::string_view bytes, const Sink& sink);

  const Counters& counters() const { return counters_; }
  /// Bytes held back until the rest of their message comes.
  std::size_t held() const { return held_.size(); }
  /// Memory that this takes: of a large message it is given back when that is done with.
  std::size_t memory() const { return held_.capacity(); }

  /// One flipped bit spoils one message; so many spoil the stream.
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

}  // namespace helicarm
