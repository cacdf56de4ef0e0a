// SPDX-License-Identifier: Apache-2.0
#include "helicarm/registration/motion.h"

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/geometry/rotation.h"

namespace helicarm::registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Writes the motion p -> p + shift + linear (p - c).
AffineMotion affine(const Vector3d& shift, const Matrix3d& linear) {
  AffineMotion motion;
  motion << shift, linear.row(0).transpose(), linear.row(1).transpose(), linear.row(2).transpose();
  return motion;
}

}  // namespace

Eigen::Matrix<double, affine_parameters, 6> affine_from_rigid() {
  Eigen::Matrix<double, affine_parameters, 6> map;
  for (int axis = 0; axis < 3; ++axis) {
    map.col(axis) = affine(Vector3d::Zero(), geometry::cross_matrix(Vector3d::Unit(axis)));
    map.col(3 + axis) = affine(Vector3d::Unit(axis), Matrix3d::Zero());
  }
  return map;
}

Eigen::Matrix<double, affine_parameters, 6> affine_from_strain(const Matrix3d& axes) {
  constexpr int pairs[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
  Eigen::Matrix<double, affine_parameters, 6> map;
  for (int k = 0; k < 6; ++k) {
    const Vector3d a = axes.col(pairs[k][0]), b = axes.col(pairs[k][1]);
    map.col(k) = affine(Vector3d::Zero(), 0.5 * (a * b.transpose() + b * a.transpose()));
  }
  return map;
}

Eigen::Matrix<double, affine_parameters, 11> affine_from_camera(const geometry::View& view,
                                                                const Vector3d& centre) {
  const Matrix3d& rotation = view.camera_from_world.rotation;
  const geometry::Intrinsics& k = view.intrinsics;
  const Vector3d at = view.camera_from_world * centre;
  // A displacement shift + linear x of camera coordinates x, for a point of the world.
  const auto in_world = [&](const Vector3d& shift, const Matrix3d& linear) {
    return affine(rotation.transpose() * (shift + linear * at), rotation.transpose() * linear * rotation);
  };
  const auto entry = [](int row, int column, double value) {
    Matrix3d linear = Matrix3d::Zero();
    linear(row, column) = value;
    return linear;
  };
  const Vector3d none = Vector3d::Zero();
  // u = fx x/z + skew y/z + u0, v = fy y/z + v0. A change of v moves y, and by the skew x as well.
  const auto moving_v = [&](int column, double value) {
    Matrix3d linear = entry(1, column, value / k.fy);
    linear(0, column) = -k.skew / k.fx * value / k.fy;
    return linear;
  };
  Eigen::Matrix<double, affine_parameters, 11> map;
  map.col(0) = in_world(none, entry(0, 0, 1 / k.fx));
  map.col(1) = in_world(none, moving_v(1, 1));
  map.col(2) = in_world(none, entry(0, 2, 1 / k.fx));
  map.col(3) = in_world(none, moving_v(2, 1));
  for (int axis = 0; axis < 3; ++axis) {
    const Matrix3d turn = geometry::cross_matrix(Vector3d::Unit(axis));
    map.col(4 + axis) = in_world(-(turn * view.camera_from_world.translation), turn);
    map.col(7 + axis) = in_world(Vector3d::Unit(axis), Matrix3d::Zero());
  }
  map.col(10) = in_world(none, entry(0, 1, 1 / k.fx));
  return map;
}

Eigen::MatrixXd cameras_with_motion(Eigen::MatrixXd camera_covariance, double motion_sigma_mm) {
  constexpr Eigen::Index translation = 7;
  for (Eigen::Index i = calibration::view_parameters; i < camera_covariance.rows();
       i += calibration::view_parameters)
    camera_covariance.diagonal().segment<3>(i + translation).array() += motion_sigma_mm * motion_sigma_mm;
  return camera_covariance;
}

geometry::RigidTransform moved_about(const geometry::RigidTransform& pose, const Vector3d& centre,
                                     const RigidStep& step) {
  const Matrix3d turn = geometry::rotation_from_vector(step.head<3>());
  return {turn * pose.rotation, turn * (pose.translation - centre) + centre + step.tail<3>()};
}

RigidStep step_about(const geometry::RigidTransform& from, const geometry::RigidTransform& to,
                     const Vector3d& centre) {
  RigidStep step;
  step.head<3>() = geometry::vector_from_rotation(to.rotation * from.rotation.transpose());
  step.tail<3>() = to * (from.inverse() * centre) - centre;
  return step;
}

Eigen::Matrix3d point_covariance(const RigidCovariance& covariance, const Vector3d& centre,
                                 const Vector3d& point) {
  Eigen::Matrix<double, 3, 6> by_step;
  by_step << -geometry::cross_matrix(point - centre), Matrix3d::Identity();
  return by_step * covariance * by_step.transpose();
}

}  // namespace helicarm::registration
