// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <Eigen/Core>
#include <tl/expected.hpp>

#include "helicarm/devices/tracker/device_clock.h"
#include "helicarm/devices/tracker/pose_sample.h"

namespace helicarm::tracker {

struct PoseGateOptions {
  double farthest_mm = 3000;  ///< range of optical trackers: 2.4 to 3 m
  double frozen_s = 0.5;  ///< noise changes the last bits of every pose: identical ones for longer are stale
  double jump_mm = 5;     ///< largest distance from the last pose ...
  double jump_mm_per_s = 500;  ///< ... plus a hand's motion in the time between
  double jump_deg = 5;
  double jump_deg_per_s = 180;
  double settle_s = 0.5;  ///< poses after a jump are accepted when they were consistent for this time
  DeviceClockOptions clock;
};

/// A pose as received. `device_s` is 0 if no time is given.
struct RawPose {
  Eigen::Matrix4d matrix;
  double device_s = 0;
  double arrival_s = 0;
  bool visible = true;
};

/// Checks one tool's poses. Rounding (|R'R - I| <= 1e-3) is corrected; the identity, which drivers send for a
/// hidden marker, is never accepted as a pose.
class PoseGate {
 public:
  explicit PoseGate(const PoseGateOptions& options = {}) : options_(options), clock_(options.clock) {}

  tl::expected<PoseSample, PoseFault> pass(const RawPose& raw);

  /// Call for a new connection.
  void forget_time() { clock_.forget(); }

  /// Position since a jump, once three poses are consistent; nothing without a jump.
  std::optional<PoseSample> elsewhere() const {
    constexpr int enough = 3;
    return rival_poses_ >= enough ? rival_ : std::nullopt;
  }

  const Counters& rejected() const { return rejected_; }  ///< by code of PoseFault
  void reject(PoseFault fault);

 private:
  tl::expected<PoseSample, PoseFault> judge(const RawPose& raw);
  bool within_reach(const geometry::RigidTransform& from, const geometry::RigidTransform& to,
                    double dt) const;
  bool frozen(const RawPose& raw);
  bool jumped(const PoseSample& sample);

  PoseGateOptions options_;
  DeviceClock clock_;
  std::optional<RawPose> unchanged_;  ///< the first of the bit-identical poses
  std::optional<PoseSample> last_;
  std::optional<PoseSample> rival_;  ///< newest of those since a jump
  double rival_since_ = 0;
  int rival_poses_ = 0;  ///< number of those
  Counters rejected_;
};

/// The rigid motion of a matrix, or its fault.
tl::expected<geometry::RigidTransform, PoseFault> rigid_pose(const Eigen::Matrix4d& matrix,
                                                             double farthest_mm);

}  // namespace helicarm::tracker
