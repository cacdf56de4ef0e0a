// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>

#include "helicarm/devices/receiver/inbox.h"

namespace helicarm::receiver {

/// Called on the source's threads, possibly at the same time. No message contains patient data.
struct ReceiverHooks {
  std::function<void(const Arrival&)> arrived = [](const Arrival&) {};
  /// A refused image or association.
  std::function<void(const Failure&)> refused = [](const Failure&) {};
  /// An incomplete image, or a connection that ended without a release: `truncated`, `bad_value` for a
  /// protocol violation, `not_connected`, `interrupted` when the receiver ends. At most 20 per second if no
  /// image was being received.
  std::function<void(const Failure&)> cut = [](const Failure&) {};
};

/// Stores X-ray images in an inbox, which outlives it, and reports each. The destructor ends its threads; an
/// image that is being stored is completed first. Members are thread-safe.
class ImageSource {
 public:
  virtual ~ImageSource() = default;
  /// Local port on which it listens; 0: none.
  virtual std::uint16_t port() const = 0;
  /// Connections lost and requests rejected since the start.
  virtual std::uint64_t broken() const = 0;
  /// Waits until no peer is connected: a peer that sent its last image then ends its association in order.
  /// False if one still is after this time.
  virtual bool await_idle([[maybe_unused]] std::chrono::milliseconds longest) { return true; }
};

/// Whether this file was stored, for sources of files. Files over 256 MiB are refused (bad_size).
bool take_file(const std::filesystem::path& file, Inbox& inbox, const ReceiverHooks& hooks);

}  // namespace helicarm::receiver
