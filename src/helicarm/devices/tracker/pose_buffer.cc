// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/pose_buffer.h"

#include <stdexcept>

namespace helicarm::tracker {

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
  const auto first_where = [this](auto&& reached) {
    std::size_t low = 0, high = samples_.size();
    while (low < high) {
      const std::size_t middle = low + (high - low) / 2;
      if (reached(at(middle).time_s))
        high = middle;
      else
        low = middle + 1;
    }
    return low;
  };
  const std::size_t first = first_where([&](double time_s) { return time_s >= from_s; });
  const std::size_t last = first_where([&](double time_s) { return time_s > to_s; });
  std::vector<PoseSample> found;
  for (std::size_t i = first; i < last; ++i) found.push_back(at(i));
  return found;
}

}  // namespace helicarm::tracker
