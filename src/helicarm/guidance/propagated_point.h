// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <utility>

#include <Eigen/Core>

#include "helicarm/guidance/poses.h"

namespace helicarm::guidance {

/// One reading of one marker, by the marker's name: points transformed by the same reading share its error.
using Reading = std::pair<std::string, int>;

/// A point carried through the frames with the first-order effect of every tracker reading on it. A measured
/// pose is the true one times a small motion (translation tau, rotation omega) about the marker's own origin.
struct PropagatedPoint {
  Eigen::Vector3d point;
  Eigen::Matrix3d covariance;                                 ///< from the X-rays
  std::map<Reading, Eigen::Matrix<double, 3, 6>> by_reading;  ///< d point / d (tau, omega)
  Eigen::Matrix3Xd by_calibration = {};                       ///< d point / d the views' parameters

  Eigen::Matrix3d total_covariance(const TrackerNoise& noise) const;
};

/// Covariance (mm^2) of the difference of two points in the same frame: errors from the same calibration (its
/// covariance given) and the same readings cancel.
Eigen::Matrix3d covariance_between(const PropagatedPoint& from, const PropagatedPoint& to,
                                   const Eigen::MatrixXd& calibration_covariance, const TrackerNoise& noise);

/// The point at this share of the way from one point to another in the same frame, with the errors of both;
/// its `covariance` contains that of the calibration they share.
PropagatedPoint point_between(const PropagatedPoint& from, const PropagatedPoint& to, double share,
                              const Eigen::MatrixXd& calibration_covariance);

/// From a marker's frame to the tracker's.
PropagatedPoint enter_tracker(PropagatedPoint point, const geometry::RigidTransform& tracker_from_marker,
                              Reading reading);

/// From the tracker's frame to a marker's.
PropagatedPoint leave_tracker(PropagatedPoint point, const geometry::RigidTransform& tracker_from_marker,
                              Reading reading);

}  // namespace helicarm::guidance
