// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>

namespace helicarm::receiver {

/// Connection limits. One address may be one C-arm or many behind a router: hence two limits.
struct AdmissionLimits {
  unsigned associations = 32;
  unsigned of_address = 16;  ///< associations from one address
  unsigned connections = 4;  ///< connections per association slot, including those not yet associated
  double spared_s = 2;       ///< an association can be replaced after this time without an image
};

/// Decides which peers may connect and associate. When full, the peer least likely to send an image is
/// closed: the oldest connection without an association, or the association longest without an image. An
/// association that is receiving an image is never closed. Has no sockets; thread-safe.
class Admission {
 public:
  using Clock = std::chrono::steady_clock;
  using Id = std::uint64_t;

  explicit Admission(const AdmissionLimits& limits) : limits_(limits) {}

  /// `evict` is called at most once, from within another member, if this connection must close; it must not
  /// block and must not call a member. Nothing if the limit is reached.
  std::optional<Id> connect(const std::string& address, std::function<void()> evict, Clock::time_point now);
  /// Whether this connection may associate.
  bool associate(Id id, Clock::time_point now);
  void image_begins(Id id);
  void image_ends(Id id, Clock::time_point now);
  /// No effect after an eviction.
  void leave(Id id);
  /// Connections that neither left nor were evicted.
  std::size_t connected();

 private:
  struct Peer {
    std::string address;
    std::function<void()> evict;
    bool associated = false;
    bool sends_image = false;
    Clock::time_point since;  ///< start of the connection or association, or end of its last image
  };
  using Peers = std::map<Id, Peer>;

  unsigned count(bool associated_only, const std::string* address) const;
  bool make_room(bool associated, const std::string* address, Clock::time_point latest);

  const AdmissionLimits limits_;
  std::mutex mutex_;
  Peers peers_;
  Id next_ = 0;
};

}  // namespace helicarm::receiver
