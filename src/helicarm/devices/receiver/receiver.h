// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "helicarm/devices/receiver/commitment.h"
#include "helicarm/devices/receiver/image_source.h"
#include "helicarm/devices/receiver/negotiation.h"

namespace helicarm::receiver {

/// PEM files. Peers must present a certificate signed by one of `authorities`.
struct TlsFiles {
  std::filesystem::path certificate;
  std::filesystem::path key;
  std::filesystem::path authorities;
};

struct ReceiverOptions {
  std::string address = "127.0.0.1";  ///< another address opens the receiver to the network
  std::uint16_t port = 11112;         ///< 0: any free port
  dicom::NegotiationOptions negotiation;
  std::optional<TlsFiles> tls;
  /// Peers that are told of a storage commitment on an association to them; others on their own.
  std::vector<ReportPeer> report_peers;
  unsigned most_associations = 32;  ///< concurrent; more are rejected as transient
  unsigned most_of_address = 16;    ///< of these, from one address
  double spared_s = 2;              ///< an association can be replaced after this time without an image
  std::size_t most_object_bytes = std::size_t{256} << 20;  ///< per image
  std::size_t most_bytes = std::size_t{512} << 20;         ///< total of images being received
  double request_limit_s = 10;                             ///< from connection to association
  double idle_limit_s = 30;                                ///< per PDU
  double echo_limit_s = 120;                               ///< for an association without an image
  double object_limit_s = 120;                             ///< from a message's first to its last byte
};

/// Counters since the start.
struct ReceiverCounters {
  std::atomic<std::uint64_t> connections{0};
  std::atomic<std::uint64_t> associations{0};
  std::atomic<std::uint64_t> rejected{0};     ///< associations
  std::atomic<std::uint64_t> aborted{0};      ///< by the peer, or by the receiver after a protocol violation
  std::atomic<std::uint64_t> timed_out{0};    ///< inactive peers that were disconnected
  std::atomic<std::uint64_t> evicted{0};      ///< replaced by another peer
  std::atomic<std::uint64_t> turned_away{0};  ///< connections above the limit
  std::atomic<std::uint64_t> accept_failures{0};  ///< e.g. no file descriptors
  std::atomic<std::uint64_t> echoed{0};
  std::atomic<std::uint64_t> stored{0};
  std::atomic<std::uint64_t> repeated{0};
  std::atomic<std::uint64_t> refused{0};         ///< images
  std::atomic<std::uint64_t> commitments{0};     ///< requests of which every image was stored
  std::atomic<std::uint64_t> reported{0};        ///< commitments, on associations to peers
  std::atomic<unsigned> reports_on_the_way{0};   ///< present number of these
  std::atomic<std::size_t> bytes_on_the_way{0};  ///< present total of images being received
};

/// Service class provider for C-STORE, C-ECHO and storage commitment. An image is acknowledged after it is
/// stored in the inbox; otherwise its status states the cause. Peers cannot block each other.
class DicomReceiver : public ImageSource {
 public:
  /// Listens on return. Refuses port_taken, and bad_value for an invalid address or TLS files.
  static Expected<std::unique_ptr<DicomReceiver>> open(const ReceiverOptions& options, Inbox& inbox,
                                                       ReceiverHooks hooks = {});
  /// Closes all connections; an image that is being stored is completed first.
  ~DicomReceiver() override;

  std::uint16_t port() const override;
  std::uint64_t broken() const override;
  bool await_idle(std::chrono::milliseconds longest) override;
  const ReceiverCounters& counters() const;

 private:
  struct Engine;
  explicit DicomReceiver(std::unique_ptr<Engine> engine);
  std::unique_ptr<Engine> engine_;
};

}  // namespace helicarm::receiver
