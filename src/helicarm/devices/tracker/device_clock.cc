// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/device_clock.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace helicarm::tracker {
namespace {

/// Keeps times distinct that a change of the smallest delay would make equal.
constexpr double least_step_s = 1e-6;
/// By less a device's threads may set stamps back.
constexpr double least_setting_s = 0.05;
/// No clock drifts from the smallest delay by so much within `settle_s`: the messages are delayed.
constexpr double delay_s = 0.1;

}  // namespace

std::string_view code(PoseFault fault) {
  switch (fault) {
    case PoseFault::hidden:
      return "hidden";
    case PoseFault::not_finite:
      return "not_finite";
    case PoseFault::all_zero:
      return "all_zero";
    case PoseFault::identity:
      return "identity";
    case PoseFault::mirrored:
      return "mirrored";
    case PoseFault::scaled:
      return "scaled";
    case PoseFault::not_rigid:
      return "not_rigid";
    case PoseFault::out_of_volume:
      return "out_of_volume";
    case PoseFault::time_equal:
      return "time_equal";
    case PoseFault::time_back:
      return "time_back";
    case PoseFault::time_jump:
      return "time_jump";
    case PoseFault::late:
      return "late";
    case PoseFault::frozen:
      return "frozen";
    case PoseFault::jump:
      return "jump";
    case PoseFault::no_rotation:
      return "no_rotation";
    case PoseFault::name_twice:
      return "name_twice";
  }
  return "unknown";
}

double DeviceClock::next(double time_s) {
  if (last_) time_s = std::max(time_s, *last_ + least_step_s);
  last_ = time_s;
  return time_s;
}

double DeviceClock::Base::recent() const { return std::min(least, earlier); }

void DeviceClock::Base::take(const Stamp& stamp, const DeviceClockOptions& options) {
  if (stamp.arrival_s - since >= options.settle_s) {
    earlier = std::exchange(least, stamp.offset());
    since = stamp.arrival_s;
  }
  least = std::min(least, stamp.offset());
  const bool is_delayed = recent() - offset > delay_s;
  const double drifted = is_delayed ? 0 : options.drift * (stamp.arrival_s - newest.arrival_s);
  offset = std::min(offset + drifted, stamp.offset());
  newest = stamp;
}

/// A stamp far ahead of the smallest delay: messages that were lost on the way leap too, but not beyond it.
bool DeviceClock::was_set(const Stamp& before, const Stamp& now) const {
  const double step_s = now.device_s - before.device_s;
  return step_s < -least_setting_s || (now.offset() < base_->offset - options_.jump_s &&
                                       step_s - (now.arrival_s - before.arrival_s) > options_.jump_s);
}

tl::expected<void, PoseFault> DeviceClock::settle(const Stamp& now) {
  set_->newest = now;
  set_->least = std::min(set_->least, now.offset());
  if (now.arrival_s - set_->since < options_.settle_s)
    return tl::unexpected(now.device_s < base_->newest.device_s ? PoseFault::time_back
                                                                : PoseFault::time_jump);
  base_->offset += set_->least - set_->before;
  base_->least = base_->earlier = set_->least;
  set_.reset();
  return {};
}

tl::expected<double, PoseFault> DeviceClock::local(double device_s, double arrival_s) {
  if (device_s == 0) return next(arrival_s);
  const Stamp now{device_s, arrival_s};
  if (!base_) {
    base_ = {now.offset(), now, now.offset(), now.offset(), arrival_s};
    return next(arrival_s);
  }
  if (set_ && std::abs(now.offset() - set_->before) <= set_->tolerance) set_.reset();
  const Stamp& before = set_ ? set_->newest : base_->newest;
  if (was_set(before, now)) {
    const double change_s = std::abs(now.offset() - base_->recent()),
                 back_s = base_->newest.device_s - device_s;
    const double tolerance = back_s > 0 ? std::min(change_s / 2, back_s) : change_s / 2;
    set_ = {base_->recent(), tolerance + least_step_s, now, now.offset(), arrival_s};
  } else if (device_s == before.device_s) {
    return tl::unexpected(PoseFault::time_equal);
  } else if (device_s < before.device_s) {
    return tl::unexpected(PoseFault::time_back);
  }
  if (set_)
    if (const auto settled = settle(now); !settled) return tl::unexpected(settled.error());
  base_->take(now, options_);
  if (now.offset() - base_->offset > options_.jump_s) return tl::unexpected(PoseFault::late);
  return next(device_s + base_->offset);
}

}  // namespace helicarm::tracker
