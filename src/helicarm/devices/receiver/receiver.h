// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "helicarm/devices/receiver/inbox.h"
#include "helicarm/devices/receiver/negotiation.h"

namespace helicarm {

/// PEM files. Peers must show a certificate that one of `authorities` has signed.
struct TlsFiles {
  std::filesystem::path certificate;
  std::filesystem::path key;
  std::filesystem::path authorities;
};

struct ReceiverOptions {
  std::string address = "127.0.0.1";  ///< another one opens the receiver to the network
  std::uint16_t port = 11112;         ///< 0: any that is free
  dicom::NegotiationOptions negotiation;
  std::optional<TlsFiles> tls;
  unsigned most_associations = 32;  ///< at once; more are rejected as transient
  unsigned most_of_address = 16;    ///< of these, from one address
  double spared_s = 2;  ///< an association without an image for so long makes room for another one
  std::size_t most_object_bytes = std::size_t{128} << 20;  ///< of one image
  std::size_t most_bytes = std::size_t{512} << 20;         ///< of all that are on the way
  double request_limit_s = 10;                             ///< from connection to association
  double idle_limit_s = 30;                                ///< for each PDU
  double echo_limit_s = 120;                               ///< for an association without an image
  double object_limit_s = 120;                             ///< from a message's first byte to its last
};

/// What happened since the start.
struct ReceiverCounters {
  std::atomic<std::uint64_t> connections{0};
  std::atomic<std::uint64_t> associations{0};
  std::atomic<std::uint64_t> rejected{0};         ///< associations
  std::atomic<std::uint64_t> aborted{0};          ///< by the peer, or by us over a breach of the protocol
  std::atomic<std::uint64_t> timed_out{0};        ///< stalled or imageless peers that were dropped
  std::atomic<std::uint64_t> evicted{0};          ///< those that made room for another
  std::atomic<std::uint64_t> turned_away{0};      ///< connections for which there was no room
  std::atomic<std::uint64_t> accept_failures{0};  ///< out of descriptors, say
  std::atomic<std::uint64_t> echoed{0};
  std::atomic<std::uint64_t> stored{0};
  std::atomic<std::uint64_t> repeated{0};
  std::atomic<std::uint64_t> refused{0};         ///< images
  std::atomic<std::size_t> bytes_on_the_way{0};  ///< now, of images that are not whole yet
};

/// Called from the receiver's threads. No message holds patient data.
struct ReceiverHooks {
  std::function<void(const Arrival&)> arrived = [](const Arrival&) {};
  /// An image, or an association.
  std::function<void(const Failure&)> refused = [](const Failure&) {};
  /// An image that did not come whole, or a connection that ended otherwise than by a release: `truncated`,
  /// `bad_value` for a breach of the protocol, `not_connected`, `interrupted` when the receiver ends. At most
  /// 20 a second where no image was on the way.
  std::function<void(const Failure&)> cut = [](const Failure&) {};
};

/// Service class provider for C-STORE and C-ECHO. An image is acknowledged once it is safely in the inbox,
/// else its status says why not. No peer can hold up another.
class DicomReceiver {
 public:
  /// Listens when it returns. Refuses port_taken, and bad_value for an address or TLS files that are none.
  static Expected<std::unique_ptr<DicomReceiver>> open(const ReceiverOptions& options, Inbox& inbox,
                                                       ReceiverHooks hooks = {});
  /// Closes all connections; an image that is being written is finished first.
  ~DicomReceiver();

  std::uint16_t port() const;
  const ReceiverCounters& counters() const;

 private:
  struct Engine;
  explicit DicomReceiver(std::unique_ptr<Engine> engine);
  std::unique_ptr<Engine> engine_;
};

}  // namespace helicarm
