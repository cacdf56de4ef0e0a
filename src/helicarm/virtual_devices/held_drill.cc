// SPDX-License-Identifier: Apache-2.0
#include "helicarm/virtual_devices/held_drill.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "helicarm/core/random.h"
#include "helicarm/devices/tracker/pose_board.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::virtual_devices {
namespace {

using Eigen::Vector3d;

constexpr std::uint32_t tremor_stream = 2900;
constexpr double tremor_mm = 0.1;
constexpr double tremor_rad = 0.1 * std::numbers::pi / 180;
/// Drift of the hand, its correction, and physiological tremor.
constexpr std::array tremor_hz{0.9, 2.3, 5.1, 9.0};

/// Where a drill enters from outside the joint, and where it leaves.
std::pair<const char*, const char*> ends_of(const std::string& bone) {
  return bone == "femur" ? std::pair("FE", "FS") : std::pair("TS", "TE");
}

geometry::RigidTransform between(const geometry::RigidTransform& from, const geometry::RigidTransform& to,
                                 double share) {
  const Vector3d turn = geometry::vector_from_rotation(from.rotation.transpose() * to.rotation);
  return {from.rotation * geometry::rotation_from_vector(share * turn),
          from.translation + share * (to.translation - from.translation)};
}

}  // namespace

HeldDrill::HeldDrill(const SimulatedScene& scene, std::uint64_t seed)
    : scene_(scene),
      seed_(seed),
      marker_from_tip_(scene.flange_from_marker().inverse() * scene.tool().flange_from_tcp) {
  RandomStream random(seed, tremor_stream);
  for (auto& axis : phase_)
    for (double& phase : axis) phase = 2 * std::numbers::pi * random.uniform();
  from_ = to_ = on_tunnel("femur", -80, 4, 5);
}

geometry::RigidTransform HeldDrill::on_tunnel(const std::string& bone, double depth_mm, double off_mm,
                                              double tilt_deg) const {
  const auto [outer, inner] = ends_of(bone);
  const geometry::RigidTransform bone_from_tracker = scene_.tracker_from(bone).inverse();
  const Vector3d enter = bone_from_tracker * scene_.point_in_tracker(outer);
  const Vector3d axis = (bone_from_tracker * scene_.point_in_tracker(inner) - enter).normalized();
  const Eigen::Matrix3d along = geometry::rotation_between(Vector3d::UnitZ(), axis);
  const Eigen::AngleAxisd tilt(tilt_deg * std::numbers::pi / 180, Vector3d::UnitX());
  return {along * tilt.toRotationMatrix(), enter + depth_mm * axis + off_mm * along.col(0)};
}

geometry::RigidTransform HeldDrill::held(double now_s) const {
  const double share = seconds_ > 0 ? std::clamp((now_s - begin_s_) / seconds_, 0.0, 1.0) : 1;
  return between(from_, to_, share);
}

void HeldDrill::move(const std::string& bone, const geometry::RigidTransform& bone_from_tip, double seconds) {
  const double now_s = tracker::monotonic_seconds();
  const std::lock_guard lock(mutex_);
  from_ = scene_.tracker_from(bone).inverse() * scene_.tracker_from(bone_) * held(now_s);
  bone_ = bone;
  to_ = bone_from_tip;
  begin_s_ = now_s;
  seconds_ = seconds;
}

void HeldDrill::correct(const geometry::RigidTransform& tip_from_next, double seconds) {
  const double now_s = tracker::monotonic_seconds();
  const std::lock_guard lock(mutex_);
  from_ = held(now_s);
  to_ = from_ * tip_from_next;
  begin_s_ = now_s;
  seconds_ = seconds;
}

geometry::RigidTransform HeldDrill::tracker_from_tip() const {
  const double now_s = tracker::monotonic_seconds();
  const std::lock_guard lock(mutex_);
  Eigen::Matrix<double, 6, 1> tremor = Eigen::Matrix<double, 6, 1>::Zero();
  for (std::size_t axis = 0; axis < phase_.size(); ++axis)
    for (std::size_t wave = 0; wave < waves; ++wave)
      tremor[Eigen::Index(axis)] +=
          std::sin(2 * std::numbers::pi * tremor_hz[wave] * now_s + phase_[axis][wave]) *
          std::sqrt(2.0 / waves);
  return scene_.tracker_from(bone_) * held(now_s) *
         geometry::RigidTransform{geometry::rotation_from_vector(tremor_rad * tremor.tail<3>()),
                                  tremor_mm * tremor.head<3>()};
}

}  // namespace helicarm::virtual_devices
