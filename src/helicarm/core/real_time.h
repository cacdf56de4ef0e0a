// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sched.h>

namespace helicarm {

/// While it lives, the calling thread has real-time priority (SCHED_FIFO, before all ordinary threads of the
/// machine) if the system permits it: to root, with CAP_SYS_NICE, or by an rtprio limit. Otherwise nothing
/// changes. For threads that mostly wait for a device; threads started meanwhile are ordinary ones.
class RealTime {
 public:
  RealTime() : policy_(::sched_getscheduler(0)) {
    constexpr int low = 10;  // of 1 to 99: before ordinary threads, after those of the kernel
    sched_param wanted{};
    wanted.sched_priority = low;
    granted_ = policy_ >= 0 && ::sched_getparam(0, &before_) == 0 &&
               ::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &wanted) == 0;
  }
  ~RealTime() {
    // Without privileges the flag cannot be cleared, and stays.
    if (granted_) ::sched_setscheduler(0, policy_ | SCHED_RESET_ON_FORK, &before_);
  }
  RealTime(const RealTime&) = delete;
  RealTime& operator=(const RealTime&) = delete;

  bool granted() const { return granted_; }

 private:
  int policy_;
  sched_param before_{};
  bool granted_ = false;
};

}  // namespace helicarm
