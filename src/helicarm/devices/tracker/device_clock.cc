// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/device_clock.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace helicarm::tracker {
namespace {

/// Keeps times distinct that a change of the smallest delay would make equal.
constexpr double least_step_s = 1e-6;

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

tl::expected<double, PoseFault> DeviceClock::local(double device_s, double arrival_s) {
  if (device_s == 0) return next(arrival_s);
  const double offset = arrival_s - device_s;
  if (!base_) {
    base_ = {offset, device_s, arrival_s, arrival_s};
    return next(arrival_s);
  }
  const bool jumped = std::abs(offset - base_->offset) > options_.jump_s;
  if (!jumped) {
    rival_.reset();
    if (device_s == base_->device_s) return tl::unexpected(PoseFault::time_equal);
    if (device_s < base_->device_s) return tl::unexpected(PoseFault::time_back);
    base_->offset = std::min(base_->offset + options_.drift * (arrival_s - base_->arrival_s), offset);
    base_->device_s = device_s;
    base_->arrival_s = arrival_s;
    return next(device_s + base_->offset);
  }
  const bool agrees =
      rival_ && std::abs(offset - rival_->offset) <= options_.jump_s && device_s > rival_->device_s;
  if (!agrees) rival_ = {offset, device_s, arrival_s, arrival_s};
  rival_->device_s = device_s;
  rival_->offset = std::min(rival_->offset, offset);
  if (arrival_s - rival_->since >= options_.settle_s) {
    base_ = std::exchange(rival_, std::nullopt);
    base_->arrival_s = arrival_s;
    return next(device_s + base_->offset);
  }
  if (device_s < base_->device_s) return tl::unexpected(PoseFault::time_back);
  return tl::unexpected(offset > base_->offset ? PoseFault::late : PoseFault::time_jump);
}

}  // namespace helicarm::tracker
