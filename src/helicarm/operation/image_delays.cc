// SPDX-License-Identifier: Apache-2.0
#include "helicarm/operation/image_delays.h"

#include <cmath>

namespace helicarm::operation {
namespace {

/// Drift between two quartz clocks, as in DeviceClock.
constexpr double drift = 1e-4;

}  // namespace

double ImageDelays::held_s(const xray::AcquisitionTime& acquired, double arrival_s) const {
  const auto least = least_.find(acquired.source);
  if (least == least_.end()) return 0;
  const double drifted_s = drift * std::abs(arrival_s - least->second.arrival_s);
  return std::max(0.0, arrival_s - acquired.seconds - least->second.delay_s - drifted_s);
}

void ImageDelays::learn(const xray::AcquisitionTime& acquired, double arrival_s) {
  if (!least_.contains(acquired.source) || held_s(acquired, arrival_s) == 0)
    least_[acquired.source] = {arrival_s - acquired.seconds, arrival_s};
}

}  // namespace helicarm::operation
