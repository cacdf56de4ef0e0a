// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "helicarm/devices/robot/kinematics.h"
#include "helicarm/devices/robot/robot_order.h"
#include "helicarm/simulation/simulate_case.h"
#include "helicarm/simulation/tracker_model.h"

/// Virtual devices: C-arm, tracker and robot that share one ground truth and use their real
/// protocols.
namespace helicarm::virtual_devices {

/// Ground truth of the scene: the simulated knee with its calibrator, movable bones, and the robot beside the
/// table. All members are thread-safe.
class SimulatedScene {
 public:
  /// Renders the X-ray images of the seed's AP and lateral view. `ct`: instead of the modelled knee, on the
  /// femur's marker; the tunnels' balls stay. Refuses as `simulate_case`.
  static Expected<std::unique_ptr<SimulatedScene>> set_up(
      std::uint64_t seed, int image_size = 1024, std::shared_ptr<const simulation::CtOptions> ct = {});

  const simulation::SimulatedCase& simulated_case() const { return simulated_case_; }

  /// "calibrator", "femur" or "tibia".
  geometry::RigidTransform tracker_from(const std::string& body) const;
  /// Pose of the bone's marker: the bone's own frame until `bump_marker`.
  geometry::RigidTransform tracker_from_marker(const std::string& bone) const;
  /// Shifts a bone's marker relative to the bone (bone's axes).
  void bump_marker(const std::string& bone, const Eigen::Vector3d& shift_mm);
  /// Moves a bone with its marker, about the marker (tracker's axes).
  void move_bone(const std::string& bone, const geometry::RigidTransform& motion_in_tracker);

  /// Rotates about this point (tracker's frame).
  void turn_bone(const std::string& bone, const Eigen::Vector3d& about, const Eigen::Matrix3d& turn);

  /// Present position of a ball at a tunnel's end (FS, FE, TS, TE).
  Eigen::Vector3d point_in_tracker(const std::string& name) const;

  /// A pointer with its tip on a tunnel's outer end in a bone, or on the surface of a ball of the calibrator,
  /// on the side from which it is held; it moves with the body. Touches of one ball alternate between sides.
  geometry::RigidTransform tracker_from_pointer() const;
  /// "femur", "tibia" or a ball's label; returns whether there is one.
  bool touch(const std::string& what);

  geometry::RigidTransform tracker_from_base() const;
  /// Moves the robot's base, e.g. after a push against its table (tracker's axes).
  void move_base(const Eigen::Vector3d& shift_mm);
  /// The drill: tip and axis (z).
  robot::RobotTool tool() const;
  /// The robot's marker: a ring of facets, some of which face the tracker in any pose.
  geometry::RigidTransform flange_from_marker() const;

 private:
  explicit SimulatedScene(simulation::SimulatedCase simulated_case);

  simulation::SimulatedCase simulated_case_;
  geometry::RigidTransform tracker_from_base_;
  mutable std::mutex mutex_;
  std::map<std::string, geometry::RigidTransform> tracker_from_;
  std::map<std::string, Eigen::Vector3d> marker_in_bone_;  ///< of bumped markers
  std::string touched_ = "femur";
  int touches_ = 0;
};

/// From the centre of its markers to its tip.
inline const Eigen::Vector3d tip_in_pointer(0, -140, -20);

/// Facets on all sides of a cube.
simulation::TrackedBody tool_markers();

/// The calibrator's facets as separate bodies; origin at the centre of a facet's markers, z outward.
struct TrackedFacet {
  std::string name;  ///< calibrator/1 .. calibrator/4
  geometry::RigidTransform calibrator_from_facet;
  simulation::TrackedBody body;
};
std::vector<TrackedFacet> calibrator_facets();

}  // namespace helicarm::virtual_devices
