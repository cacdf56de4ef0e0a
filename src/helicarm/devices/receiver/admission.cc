// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/receiver/admission.h"

#include <algorithm>

namespace helicarm::receiver {

unsigned Admission::count(bool associated_only, const std::string* address) const {
  return static_cast<unsigned>(std::ranges::count_if(peers_, [&](const auto& entry) {
    const Peer& peer = entry.second;
    return (peer.associated || !associated_only) && (!address || peer.address == *address);
  }));
}

/// Ends the connection that is (or is not) associated and has been longest without an image, if since before
/// `latest`.
bool Admission::make_room(bool associated, const std::string* address, Clock::time_point latest) {
  auto longest = peers_.end();
  for (auto it = peers_.begin(); it != peers_.end(); ++it) {
    const Peer& peer = it->second;
    if (peer.associated != associated || peer.sends_image || peer.since > latest ||
        (address && peer.address != *address))
      continue;
    if (longest == peers_.end() || peer.since < longest->second.since) longest = it;
  }
  if (longest == peers_.end()) return false;
  longest->second.evict();
  peers_.erase(longest);
  return true;
}

std::optional<Admission::Id> Admission::connect(const std::string& address, std::function<void()> evict,
                                                Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  const bool address_is_full = count(false, &address) >= limits_.connections * limits_.of_address;
  if (address_is_full || peers_.size() >= std::size_t{limits_.connections} * limits_.associations)
    if (!make_room(false, address_is_full ? &address : nullptr, now)) return std::nullopt;
  peers_.emplace(next_, Peer{address, std::move(evict), false, false, now});
  return next_++;
}

bool Admission::associate(Id id, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  const auto found = peers_.find(id);
  if (found == peers_.end()) return false;
  Peer& peer = found->second;
  const bool address_is_full = count(true, &peer.address) >= limits_.of_address;
  if (address_is_full || count(true, nullptr) >= limits_.associations) {
    const auto spared =
        std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(limits_.spared_s));
    if (!make_room(true, address_is_full ? &peer.address : nullptr, now - spared)) return false;
  }
  peer.associated = true;
  peer.since = now;
  return true;
}

void Admission::image_begins(Id id) {
  const std::lock_guard lock(mutex_);
  if (const auto found = peers_.find(id); found != peers_.end()) found->second.sends_image = true;
}

void Admission::image_ends(Id id, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  if (const auto found = peers_.find(id); found != peers_.end()) {
    found->second.sends_image = false;
    found->second.since = now;
  }
}

std::size_t Admission::connected() {
  const std::lock_guard lock(mutex_);
  return peers_.size();
}

void Admission::leave(Id id) {
  const std::lock_guard lock(mutex_);
  peers_.erase(id);
}

}  // namespace helicarm::receiver
