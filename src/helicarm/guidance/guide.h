// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/guidance/poses.h"
#include "helicarm/guidance/propagated_point.h"

namespace helicarm {

/// A view that shows a point, and where everything was when it was taken.
struct DatedView {
  View view;            ///< world = calibrator
  Poses poses;          ///< at the moment of the exposure
  double sigma_px = 1;  ///< weight of this ray among the others, per axis
};

/// A point as the X-rays gave it. `anchor` is the frame in which its rays were intersected: the calibrator,
/// or the bone with which it moves, whose poses every view must then hold.
struct XrayPoint {
  Eigen::Vector3d point_in_anchor;       ///< mm
  Eigen::Matrix3d covariance_in_anchor;  ///< mm^2, from pixels and calibration alone
  std::optional<Bone> anchor;            ///< nothing: the calibrator
  std::vector<DatedView> views;          ///< the first one's moment dates `in_calibrator`
  Eigen::Matrix3Xd by_calibration = {};  ///< d point / d the views' parameters
};

/// A point carried calibrator -> tracker -> bone -> now -> tool (Eq. 16); absent where a reading is missing.
/// The covariances hold the tracker's noise too.
struct PointInFrames {
  Eigen::Vector3d in_calibrator = Eigen::Vector3d::Zero();  ///< at the first view's moment
  Eigen::Matrix3d covariance_in_calibrator = Eigen::Matrix3d::Zero();
  std::optional<Eigen::Vector3d> in_femur;
  std::optional<Eigen::Vector3d> in_tibia;
  std::optional<Eigen::Vector3d> in_tool;
  std::optional<Eigen::Matrix3d> covariance_in_femur;
  std::optional<Eigen::Matrix3d> covariance_in_tibia;
  std::optional<Eigen::Matrix3d> covariance_in_tool;
  std::optional<PropagatedPoint> propagated_to_tool;  ///< with all that it shares with other points
};

/// The same image seen from a bone: world = bone. Intersecting in such views lets the bone move between
/// acquisitions.
View seen_from_bone(const View& view, const RigidTransform& calibrator_from_bone);

/// What the tracker's noise in one exposure's readings does to the place in the calibrator of a point of the
/// bone, mm^2. The poses must hold calibrator and bone.
Eigen::Matrix3d noise_of_poses(const Eigen::Vector3d& point_in_bone, Bone bone, const Poses& poses,
                               const TrackerNoise& noise);

/// Eq. 16. A point that moves with no bone is taken to rest in the tracker's frame since the first view.
PointInFrames guide(const XrayPoint& point, const Poses& now, const TrackerNoise& noise);

}  // namespace helicarm
