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
  double jump_s = 0.5;    ///< a stamp that is later or earlier by more at its arrival is refused
  double settle_s = 1;    ///< a clock that was set is accepted after this time
  double drift = 100e-6;  ///< of the device's clock relative to ours: twice the 50 ppm of a poor quartz
};

/// Maps one tool's time stamps to this machine's monotonic clock by the smallest observed delay. Where the
/// stamps themselves go back or leap ahead, the device's clock was set, and the mapping follows by as much.
/// Where their steps stay as they were and only the arrivals are later, the messages are delayed: until they
/// catch up or the connection is new, they stay as old as they are.
class DeviceClock {
 public:
  explicit DeviceClock(const DeviceClockOptions& options = {}) : options_(options) {}

  /// Time of a measurement, strictly increasing. `device_s` 0 means no stamp: the arrival time is used.
  /// Refuses with time_equal, time_back, time_jump or late.
  tl::expected<double, PoseFault> local(double device_s, double arrival_s);

  /// Call for a new connection: the time base may differ.
  void forget() { base_.reset(), set_.reset(); }

 private:
  struct Stamp {
    double device_s, arrival_s;
    double offset() const { return arrival_s - device_s; }
  };
  struct Base {
    double offset;  ///< local minus device time: of the smallest delay
    Stamp newest;
    double least, earlier;  ///< offsets of the present and of the previous interval of `settle_s`
    double since;           ///< arrival of the interval's first stamp
    double recent() const;
    void take(const Stamp& stamp, const DeviceClockOptions& options);
  };
  /// Stamps since the clock seems to have been set.
  struct Setting {
    double before;     ///< recent offset
    double tolerance;  ///< a stamp this near to it shows that the clock was not set
    Stamp newest;
    double least;  ///< offset
    double since;  ///< arrival of the first
  };
  bool was_set(const Stamp& before, const Stamp& now) const;
  /// Whether the stamps since the setting are accepted with this one.
  tl::expected<void, PoseFault> settle(const Stamp& now);
  double next(double time_s);

  DeviceClockOptions options_;
  std::optional<Base> base_;
  std::optional<Setting> set_;
  std::optional<double> last_;
};

}  // namespace helicarm::tracker
