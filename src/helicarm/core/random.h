// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include <Random123/philox.h>

namespace helicarm {

/// Counter-based random numbers (Philox 4x32-10, Salmon et al. 2011), keyed by (seed, stream, trial): any
/// trial can be replayed alone and nothing depends on threads or order.
class RandomStream {
 public:
  RandomStream(std::uint64_t seed, std::uint32_t stream, std::uint64_t trial = 0)
      : key_{{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)}},
        counter_{{0, stream, static_cast<std::uint32_t>(trial), static_cast<std::uint32_t>(trial >> 32)}} {}

  std::uint32_t bits() {
    if (used_ == 4) {
      block_ = r123::Philox4x32()(counter_, key_);
      ++counter_[0];
      used_ = 0;
    }
    return block_[used_++];
  }

  /// In the open interval (0, 1).
  double uniform() {
    const std::uint64_t word = (std::uint64_t{bits()} << 21) ^ (bits() >> 11);
    return (static_cast<double>(word & ((std::uint64_t{1} << 53) - 1)) + 0.5) * 0x1p-53;
  }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }

  /// Standard normal (Box and Muller 1958).
  double normal() {
    if (have_spare_) {
      have_spare_ = false;
      return spare_;
    }
    const double radius = std::sqrt(-2 * std::log(uniform()));
    const double angle = 2 * std::numbers::pi * uniform();
    spare_ = radius * std::sin(angle);
    have_spare_ = true;
    return radius * std::cos(angle);
  }

  /// Whole number in 0 .. count - 1.
  std::uint32_t index(std::uint32_t count) {
    return static_cast<std::uint32_t>((std::uint64_t{bits()} * count) >> 32);
  }

 private:
  r123::Philox4x32::key_type key_;
  r123::Philox4x32::ctr_type counter_;
  r123::Philox4x32::ctr_type block_{};
  int used_ = 4;
  double spare_ = 0;
  bool have_spare_ = false;
};

}  // namespace helicarm
