// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>

#include "helicarm/geometry/view.h"
#include "helicarm/guidance/poses.h"
#include "helicarm/guidance/propagated_point.h"
#include "helicarm/localization/locate.h"

namespace helicarm::guidance {

/// A view that shows a point, with the tracked poses at its acquisition.
struct DatedView {
  geometry::View view;  ///< world = calibrator
  Poses poses;          ///< at the acquisition
  double sigma_px = 1;  ///< standard deviation of the pixel per axis: weight of this ray
};

/// A point in the frame of a marker.
struct Place {
  PropagatedPoint propagated;  ///< with all errors it shares with other points
  Eigen::Matrix3d covariance;  ///< of all errors, the tracker's noise included, mm^2

  const Eigen::Vector3d& point() const { return propagated.point; }
};

/// A point transformed calibrator -> tracker -> bone -> present tracker -> tool (Eq. 16); absent where a
/// reading is missing.
struct PointInFrames {
  Eigen::Vector3d in_calibrator = Eigen::Vector3d::Zero();  ///< at the first view's acquisition
  Eigen::Matrix3d covariance_in_calibrator = Eigen::Matrix3d::Zero();
  std::map<Bone, Place> in_bones = {};
  std::optional<Place> in_tool = {};

  /// Nothing where it is not known.
  const Place* in(const Bone& bone) const;
};

/// The same view in a bone's frame: world = bone. Intersection of such views accounts for bone motion between
/// acquisitions.
geometry::View seen_from_bone(const geometry::View& view,
                              const geometry::RigidTransform& calibrator_from_bone);

/// Covariance (mm^2) of a bone point's position in the calibrator due to the tracker's noise at one
/// acquisition. The poses must contain calibrator and bone.
Eigen::Matrix3d noise_of_poses(const Eigen::Vector3d& point_in_bone, const Bone& bone, const Poses& poses,
                               const TrackerNoise& noise);

/// Eq. 16 for a point located in these views. `anchor` is the bone in whose frame its rays were intersected,
/// whose poses every view must then contain; nothing: the calibrator, and the point is taken as fixed in the
/// tracker's frame since the first view.
PointInFrames guide(const localization::LocatedPoint& point, const std::optional<Bone>& anchor,
                    std::span<const DatedView> views, const Poses& now, const TrackerNoise& noise);

/// Carries a point from a bone's frame to that of the tool by their present readings, which are independent
/// of those at the acquisitions (Eq. 16's last two factors).
PropagatedPoint to_tool(PropagatedPoint in_bone, const Bone& bone,
                        const geometry::RigidTransform& tracker_from_bone,
                        const geometry::RigidTransform& tracker_from_tool);

}  // namespace helicarm::guidance
