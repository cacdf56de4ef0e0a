// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include <tl/expected.hpp>

namespace helicarm {

/// Why a pose is not believed.
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
};

std::string_view code(PoseFault fault);

struct DeviceClockOptions {
  double jump_s = 0.5;    ///< a stamp that differs by more from what the arrival lets expect is a jump
  double settle_s = 1;    ///< so long the stamps must agree with each other before a new time base is taken
  double drift = 100e-6;  ///< of the device's clock against ours: twice the 50 ppm of a poor quartz
};

/// Brings one tool's time stamps to this machine's monotonic clock, by the least delay seen.
class DeviceClock {
 public:
  explicit DeviceClock(const DeviceClockOptions& options = {}) : options_(options) {}

  /// The time of a measurement, strictly increasing. `device_s` 0 means none is given: the arrival serves.
  /// Refuses with time_equal, time_back, time_jump or late.
  tl::expected<double, PoseFault> local(double device_s, double arrival_s);

  /// A new connection may have another time base.
  void forget() { base_.reset(), rival_.reset(); }

 private:
  struct Base {
    double offset;    ///< ours minus the device's
    double device_s;  ///< newest
    double since;     ///< arrival of the first
    double arrival_s;
  };
  double next(double time_s);

  DeviceClockOptions options_;
  std::optional<Base> base_;
  std::optional<Base> rival_;  ///< what the stamps say since they jumped
  std::optional<double> last_;
};

}  // namespace helicarm
