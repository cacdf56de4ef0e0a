// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <mutex>
#include <utility>

namespace helicarm {

/// Is told which share of some work is done, 0 to 1, never falling; from any thread, one call at a time.
using TellShare = std::function<void(double)>;

/// Of work that is the part from `begin` to `end` of a whole.
inline TellShare part_of(TellShare whole, double begin, double end) {
  if (!whole) return {};
  return [whole = std::move(whole), begin, end](double share) { whole(begin + (end - begin) * share); };
}

/// Counts units of equal work that end on any thread.
class UnitsDone {
 public:
  UnitsDone(TellShare tell, std::size_t count) : tell_(std::move(tell)), count_(count) {}

  void one() {
    if (!tell_) return;
    const std::lock_guard lock(guard_);
    tell_(double(++done_) / double(count_));
  }

 private:
  TellShare tell_;
  std::size_t count_;
  std::size_t done_ = 0;
  std::mutex guard_;
};

}  // namespace helicarm
