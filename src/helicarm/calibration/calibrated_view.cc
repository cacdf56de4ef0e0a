// SPDX-License-Identifier: Apache-2.0
#include "helicarm/calibration/calibrated_view.h"

#include "helicarm/geometry/rotation.h"

namespace helicarm::calibration {

Eigen::Matrix3d source_covariance(const CalibratedView& view) {
  const geometry::RigidTransform& pose = view.view.camera_from_world;
  const Eigen::Matrix3d turn = pose.rotation.transpose();  // the source is at -R' t
  Eigen::Matrix<double, 3, 6> by_pose;
  by_pose << -turn * geometry::cross_matrix(pose.translation), -turn;
  return by_pose * view.covariance.block<6, 6>(4, 4) * by_pose.transpose();
}

}  // namespace helicarm::calibration
