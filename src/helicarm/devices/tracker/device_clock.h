// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include <tl/expected.hpp>

namespace helicarm::tracker {

/// Why a pose is rejected.
enum class PoseFault {
  hidden,
  not_finite,
  all_zero,
  identity,
  mirrored,
  scaled,
  not_rigid,
  out_of_volume,
  time_equal,
  time_back,
  time_jump,
  late,
  frozen,
  jump,
  name_twice,
  no_rotation,
};

std::string_view code(PoseFault fault);

struct DeviceClockOptions {
  double jump_s = 0.5;    ///< a stamp that differs by more from the one expected at its arrival is a jump
  double settle_s = 1;    ///< a new time base is accepted after stamps were consistent for this time
  double drift = 100e-6;  ///< of the device's clock relative to ours: twice the 50 ppm of a poor quartz
};

/// Maps one tool's time stamps to this machine's monotonic clock by the smallest observed delay.
class DeviceClock {
 public:
  explicit DeviceClock(const DeviceClockOptions& options = {}) : options_(options) {}

  /// Time of a measurement, strictly increasing. `device_s` 0 means no stamp: the arrival time is used.
  /// Refuses with time_equal, time_back, time_jump or late.
  tl::expected<double, PoseFault> local(double device_s, double arrival_s);

  /// Call for a new connection: the time base may differ.
  void forget() { base_.reset(), rival_.reset(); }

 private:
  struct Base {
    double offset;    ///< local minus device time
    double device_s;  ///< newest
    double since;     ///< arrival of the first
    double arrival_s;
  };
  double next(double time_s);

  DeviceClockOptions options_;
  std::optional<Base> base_;
  std::optional<Base> rival_;  ///< time base of the stamps since a jump
  std::optional<double> last_;
};

}  // namespace helicarm::tracker
