// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm::tracker {

/// The newest poses of one tool, ordered by time.
class PoseBuffer {
 public:
  /// 4,096 poses: a minute at 60 Hz, four seconds at 1,000 Hz.
  explicit PoseBuffer(std::size_t capacity = 4096) : capacity_(capacity) {}

  /// `time_s` must be later than that of the previous pose, else throws std::invalid_argument.
  void push(const PoseSample& sample);

  std::size_t size() const { return samples_.size(); }
  std::optional<PoseSample> latest() const;
  /// Both ends included.
  std::vector<PoseSample> between(double from_s, double to_s) const;

 private:
  const PoseSample& at(std::size_t index) const { return samples_[(oldest_ + index) % samples_.size()]; }

  std::size_t capacity_;
  std::size_t oldest_ = 0;
  std::vector<PoseSample> samples_;
};

}  // namespace helicarm::tracker
