// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/pose_buffer.h"

#include <algorithm>
#include <ranges>
#include <stdexcept>

namespace helicarm {

void PoseBuffer::push(const PoseSample& sample) {
  if (!samples_.empty() && sample.time_s <= latest()->time_s)
    throw std::invalid_argument("poses must be pushed in the order of their times");
  if (samples_.size() < capacity_) {
    samples_.push_back(sample);
  } else {
    samples_[oldest_] = sample;
    oldest_ = (oldest_ + 1) % capacity_;
  }
}

std::optional<PoseSample> PoseBuffer::latest() const {
  if (samples_.empty()) return std::nullopt;
  return at(samples_.size() - 1);
}

std::vector<PoseSample> PoseBuffer::between(double from_s, double to_s) const {
  const auto indices = std::views::iota(std::size_t{0}, samples_.size());
  const auto time = [this](std::size_t i) { return at(i).time_s; };
  const auto first = std::ranges::lower_bound(indices, from_s, {}, time);
  const auto last = std::ranges::upper_bound(indices, to_s, {}, time);
  std::vector<PoseSample> found;
  for (auto i = first; i < last; ++i) found.push_back(at(*i));
  return found;
}

}  // namespace helicarm
