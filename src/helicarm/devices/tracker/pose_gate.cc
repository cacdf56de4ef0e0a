// SPDX-License-Identifier: Apache-2.0
#include "helicarm/devices/tracker/pose_gate.h"

#include <numbers>

#include "helicarm/geometry/rotation.h"

namespace helicarm::tracker {
namespace {

constexpr double rigid_tolerance = 1e-3;  // drivers of NDI and MicronTracker round to about 1e-4
constexpr double degrees = 180 / std::numbers::pi;

double off_identity(const Eigen::Matrix3d& gram) { return (gram - Eigen::Matrix3d::Identity()).norm(); }

}  // namespace

tl::expected<geometry::RigidTransform, PoseFault> rigid_pose(const Eigen::Matrix4d& matrix,
                                                             double farthest_mm) {
  if (!matrix.allFinite()) return tl::unexpected(PoseFault::not_finite);
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const Eigen::Vector3d position = matrix.topRightCorner<3, 1>();
  if (rotation.isZero(0)) return tl::unexpected(PoseFault::all_zero);
  if (rotation == Eigen::Matrix3d::Identity() && position.isZero(0))
    return tl::unexpected(PoseFault::identity);
  const Eigen::Matrix3d gram = rotation.transpose() * rotation;
  const double square = gram.trace() / 3;
  if (off_identity(gram / square) > rigid_tolerance ||
      (matrix.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() > rigid_tolerance)
    return tl::unexpected(PoseFault::not_rigid);
  if (off_identity(gram) > rigid_tolerance) return tl::unexpected(PoseFault::scaled);
  if (rotation.determinant() < 0) return tl::unexpected(PoseFault::mirrored);
  if (position.norm() > farthest_mm) return tl::unexpected(PoseFault::out_of_volume);
  return geometry::RigidTransform{geometry::nearest_rotation(rotation), position};
}

void PoseGate::reject(PoseFault fault) { ++rejected_[std::string(code(fault))]; }

tl::expected<PoseSample, PoseFault> PoseGate::pass(const RawPose& raw) {
  auto sample = judge(raw);
  if (!sample) reject(sample.error());
  return sample;
}

tl::expected<PoseSample, PoseFault> PoseGate::judge(const RawPose& raw) {
  if (!raw.visible) {
    // A clock that is set meanwhile is seen by its step.
    if (std::isfinite(raw.device_s) && raw.device_s != 0)
      static_cast<void>(clock_.local(raw.device_s, raw.arrival_s));
    return tl::unexpected(PoseFault::hidden);
  }
  if (!std::isfinite(raw.device_s)) return tl::unexpected(PoseFault::not_finite);
  const auto pose = rigid_pose(raw.matrix, options_.farthest_mm);
  if (!pose) return tl::unexpected(pose.error());
  const auto time = clock_.local(raw.device_s, raw.arrival_s);
  if (!time) return tl::unexpected(time.error());
  if (frozen(raw)) return tl::unexpected(PoseFault::frozen);
  const PoseSample sample{*time, raw.device_s, raw.arrival_s, *pose};
  if (jumped(sample)) return tl::unexpected(PoseFault::jump);
  last_ = sample;
  return sample;
}

bool PoseGate::frozen(const RawPose& raw) {
  if (unchanged_ && unchanged_->matrix == raw.matrix)
    return raw.arrival_s - unchanged_->arrival_s > options_.frozen_s;
  unchanged_ = raw;
  return false;
}

bool PoseGate::within_reach(const geometry::RigidTransform& from, const geometry::RigidTransform& to,
                            double dt) const {
  const geometry::RigidTransform step = from.inverse() * to;
  return step.translation.norm() <= options_.jump_mm + options_.jump_mm_per_s * dt &&
         geometry::vector_from_rotation(step.rotation).norm() * degrees <=
             options_.jump_deg + options_.jump_deg_per_s * dt;
}

bool PoseGate::jumped(const PoseSample& sample) {
  if (!last_) return false;
  const geometry::RigidTransform& pose = sample.tracker_from_tool;
  // Time without poses at the old position does not bring the new one within the limit.
  const double dt = sample.time_s - (rival_ ? rival_ : last_)->time_s;
  if (within_reach(last_->tracker_from_tool, pose, dt)) {
    rival_.reset();
    return false;
  }
  if (!rival_ || !within_reach(rival_->tracker_from_tool, pose, dt)) {
    rival_since_ = sample.time_s;
    rival_poses_ = 0;
  }
  rival_ = sample;
  ++rival_poses_;
  if (sample.time_s - rival_since_ < options_.settle_s) return true;
  rival_.reset();
  return false;
}

}  // namespace helicarm::tracker
