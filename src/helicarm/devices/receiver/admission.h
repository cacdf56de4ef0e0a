// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>

namespace helicarm {

/// Room for peers. One address may be a C-arm, or many behind one router: hence two limits.
struct AdmissionLimits {
  unsigned associations = 32;
  unsigned of_address = 16;  ///< associations of one address
  unsigned connections = 4;  ///< for each association's place: also those that asked for no association yet
  double spared_s = 2;       ///< an association makes room for another after so long without an image
};

/// Who may connect and associate. Where there is no room, whoever is least likely to send an image makes
/// some: the oldest connection without an association, and the association that sent none for longest. An
/// association with an image on the way is never ended. Knows no sockets; from any thread.
class Admission {
 public:
  using Clock = std::chrono::steady_clock;
  using Id = std::uint64_t;

  explicit Admission(const AdmissionLimits& limits) : limits_(limits) {}

  /// `evict` is called, once and within another member, if this connection must make room; it must not wait
  /// and call no member. Nothing where there is no room.
  std::optional<Id> connect(const std::string& address, std::function<void()> evict, Clock::time_point now);
  /// Whether there is room for this connection's association.
  bool associate(Id id, Clock::time_point now);
  void image_begins(Id id);
  void image_ends(Id id, Clock::time_point now);
  /// No effect after an eviction.
  void leave(Id id);

 private:
  struct Peer {
    std::string address;
    std::function<void()> evict;
    bool associated = false;
    bool sends_image = false;
    Clock::time_point since;  ///< of the connection, the association, its last image
  };
  using Peers = std::map<Id, Peer>;

  unsigned count(bool associated_only, const std::string* address) const;
  bool make_room(bool associated, const std::string* address, Clock::time_point latest);

  const AdmissionLimits limits_;
  std::mutex mutex_;
  Peers peers_;
  Id next_ = 0;
};

}  // namespace helicarm
