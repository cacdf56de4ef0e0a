// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <mutex>

#include "helicarm/virtual_devices/simulated_scene.h"

namespace helicarm::virtual_devices {

/// A drill in a person's hand. The hand follows the bone and trembles: 0.1 mm and 0.1 degrees rms per axis at
/// 1 to 9 Hz. All members are thread-safe.
class HeldDrill {
 public:
  /// Held 80 mm before the femur's tunnel, 4 mm and 5 degrees off its axis.
  HeldDrill(const SimulatedScene& scene, std::uint64_t seed);

  /// Moves the drill to this pose of its tip (z along it) in the bone's frame at constant speed.
  void move(const std::string& bone, const geometry::RigidTransform& bone_from_tip, double seconds);
  /// Moves the present target by this motion in the tip's frame, as a person who follows the guidance.
  void correct(const geometry::RigidTransform& tip_from_next, double seconds);

  /// With the tremor.
  geometry::RigidTransform tracker_from_tip() const;
  const geometry::RigidTransform& marker_from_tip() const { return marker_from_tip_; }
  std::uint64_t seed() const { return seed_; }

  /// The tip at this depth on the true axis of the bone's tunnel, as seen from outside, displaced by x (mm)
  /// and tilted (degrees).
  geometry::RigidTransform on_tunnel(const std::string& bone, double depth_mm, double off_mm = 0,
                                     double tilt_deg = 0) const;

 private:
  geometry::RigidTransform held(double now_s) const;

  static constexpr std::size_t waves = 4;
  const SimulatedScene& scene_;
  std::uint64_t seed_;
  geometry::RigidTransform marker_from_tip_;
  std::array<std::array<double, waves>, 6> phase_;
  mutable std::mutex mutex_;
  std::string bone_ = "femur";
  geometry::RigidTransform from_, to_;  ///< bone_from_tip
  double begin_s_ = 0, seconds_ = 0;
};

}  // namespace helicarm::virtual_devices
