// SPDX-License-Identifier: Apache-2.0
#include "stop_signal.h"

#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>

#include <unistd.h>

namespace helicarm::cli {
namespace {

sigset_t both() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  return set;
}

}  // namespace

StopSignal::StopSignal() {
  const sigset_t set = both();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
}

bool StopSignal::wait(std::optional<double> seconds) {
  using Clock = std::chrono::steady_clock;
  const sigset_t set = both();
  const auto start = Clock::now();
  while (true) {
    if (!seconds) {
      if (sigwaitinfo(&set, nullptr) > 0) return true;
      continue;
    }
    const double left = *seconds - std::chrono::duration<double>(Clock::now() - start).count();
    if (left <= 0) return false;
    const timespec time{static_cast<time_t>(left), static_cast<long>((left - std::floor(left)) * 1e9)};
    if (sigtimedwait(&set, nullptr, &time) > 0) return true;
  }
}

void StopSignal::raise() { ::kill(::getpid(), SIGTERM); }

}  // namespace helicarm::cli
