// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <Eigen/Core>
#include <tl/expected.hpp>

#include "helicarm/devices/tracker/device_clock.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm {

struct PoseGateOptions {
  double farthest_mm = 3000;  ///< optical trackers see 2.4 to 3 m
  double frozen_s = 0.5;      ///< noise changes the last bits of every pose: the same ones for longer are old
  double jump_mm = 5;         ///< a pose may be off the last by this ...
  double jump_mm_per_s = 500;  ///< ... and what a hand does in the time between
  double jump_deg = 5;
  double jump_deg_per_s = 180;
  double settle_s = 0.5;  ///< so long poses after a jump must agree with each other to be believed again
  DeviceClockOptions clock;
};

/// A pose as it came. `device_s` is 0 where no time is given.
struct RawPose {
  Eigen::Matrix4d matrix;
  double device_s = 0;
  double arrival_s = 0;
  bool visible = true;
};

/// Judges one tool's poses as they come. Rounding (|R'R - I| <= 1e-3) is corrected; the identity, which
/// drivers send for a hidden marker, is never a pose.
class PoseGate {
 public:
  explicit PoseGate(const PoseGateOptions& options = {}) : options_(options), clock_(options.clock) {}

  tl::expected<PoseSample, PoseFault> pass(const RawPose& raw);

  /// To be called when the connection is new.
  void forget_time() { clock_.forget(); }

  /// Where it is seen since a jump, once three poses agree; nothing where it is where it was.
  std::optional<PoseSample> elsewhere() const {
    constexpr int enough = 3;
    return rival_poses_ >= enough ? rival_ : std::nullopt;
  }

  const Counters& rejected() const { return rejected_; }  ///< by code of PoseFault
  void reject(PoseFault fault);

 private:
  tl::expected<PoseSample, PoseFault> judge(const RawPose& raw);
  bool within_reach(const RigidTransform& from, const RigidTransform& to, double dt) const;
  bool frozen(const RawPose& raw);
  bool jumped(const PoseSample& sample);

  PoseGateOptions options_;
  DeviceClock clock_;
  std::optional<RawPose> unchanged_;  ///< the first of the poses that are the same to the bit
  std::optional<PoseSample> last_;
  std::optional<PoseSample> rival_;  ///< newest of those since a jump
  double rival_since_ = 0;
  int rival_poses_ = 0;  ///< since then
  Counters rejected_;
};

/// What is wrong with a matrix by itself, or the rigid motion that it is.
tl::expected<RigidTransform, PoseFault> rigid_pose(const Eigen::Matrix4d& matrix, double farthest_mm);

}  // namespace helicarm
