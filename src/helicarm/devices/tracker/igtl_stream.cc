// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/igtl_stream.h"

#include <fmt/format.h>

namespace helicarm::tracker {
namespace {

constexpr std::size_t usual_message = std::size_t{64} << 10;

}  // namespace

Expected<void> IgtlStream::feed(std::string_view bytes, const Sink& sink) {
  const bool whole = held_.empty();
  if (!whole) held_ += bytes;
  const std::string_view all = whole ? bytes : held_;
  const Expected<std::size_t> used = consume(all, sink);
  if (!used) return tl::unexpected(used.error());
  if (whole)
    held_ = all.substr(*used);
  else
    held_.erase(0, *used);
  if (held_.capacity() > usual_message && held_.size() <= usual_message && *used > 0) held_.shrink_to_fit();
  return {};
}

/// Delivers every complete message; returns the number of bytes consumed.
Expected<std::size_t> IgtlStream::consume(std::string_view bytes, const Sink& sink) {
  std::size_t used = 0;
  while (true) {
    if (!header_) {
      if (bytes.size() - used < IgtlHeader::size) return used;
      auto header = decode_header(bytes.substr(used, IgtlHeader::size));
      if (!header) return tl::unexpected(header.error());
      if (header->body_size > most_body_bytes_)
        return fail(Reason::bad_size, fmt::format("{}: body of {} bytes, limit {}", header->type,
                                                  header->body_size, most_body_bytes_));
      header_ = *std::move(header);
      used += IgtlHeader::size;
    }
    if (bytes.size() - used < header_->body_size) return used;
    const std::size_t size = header_->body_size;
    if (auto done = deliver(bytes.substr(used, size), sink); !done) return tl::unexpected(done.error());
    used += size;
    header_.reset();
  }
}

Expected<void> IgtlStream::deliver(std::string_view body, const Sink& sink) {
  auto message = decode(*header_, body);
  if (message) {
    wrong_crcs_ = 0;
    ++counters_["messages"];
    if (std::holds_alternative<IgtlUnknown>(message->content)) ++counters_["unknown_type"];
    sink(*std::move(message));
    return {};
  }
  const Failure& failure = message.error();
  if (failure.figures.contains("crc")) {
    ++counters_["wrong_crc"];
    if (++wrong_crcs_ == max_wrong_crcs)
      return fail(Reason::bad_value, fmt::format("{} consecutive wrong checksums", max_wrong_crcs));
  } else {
    ++counters_[failure.reason == Reason::unsupported ? "unsupported_version" : "malformed"];
  }
  return {};
}

}  // namespace helicarm::tracker
