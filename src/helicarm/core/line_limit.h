// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <mutex>
#include <optional>
#include <utility>

namespace helicarm {

/// Limits the rate of log lines that remote peers can cause: `lines_a_second` pass, the others are counted.
/// Thread-safe.
class LineLimit {
 public:
  using Clock = std::chrono::steady_clock;
  explicit LineLimit(unsigned lines_a_second) : most_(lines_a_second) {}

  /// Number of lines dropped before this one, or nothing if this one is dropped.
  std::optional<std::uint64_t> pass(Clock::time_point now = Clock::now()) {
    const std::lock_guard lock(mutex_);
    if (now - second_ >= std::chrono::seconds(1)) {
      second_ = now;
      passed_ = 0;
    }
    if (passed_ == most_) {
      ++left_out_;
      return std::nullopt;
    }
    ++passed_;
    return std::exchange(left_out_, 0);
  }

 private:
  const unsigned most_;
  std::mutex mutex_;
  Clock::time_point second_{};
  unsigned passed_ = 0;
  std::uint64_t left_out_ = 0;
};

}  // namespace helicarm
