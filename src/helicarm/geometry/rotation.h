// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::geometry {

/// Angles of Eq. 5, rad. At beta = +-90 degrees only the sum or difference of alpha and gamma is determined:
/// gamma is set to 0 and the angles are marked as locked.
struct EulerAngles {
  double alpha = 0;
  double beta = 0;
  double gamma = 0;
  bool gimbal_locked = false;
};

/// Eq. 5 with r13 = -CaSbCg + SaSg; as published (SbSg) the matrix is not a rotation.
Eigen::Matrix3d rotation_from_euler(double alpha, double beta, double gamma);

/// Inverse of `rotation_from_euler`, beta in [-90, 90] degrees.
EulerAngles euler_from_rotation(const Eigen::Matrix3d& rotation);

/// v x p = cross_matrix(v) * p.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& vector);

/// Rotation vector (rad) to matrix and back; the returned length is at most pi.
Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& vector);
Eigen::Vector3d vector_from_rotation(const Eigen::Matrix3d& rotation);

/// The least rotation that turns the direction of `from` into that of `to`; of opposite ones, half a turn
/// about any axis across them. Of any length but 0.
Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

/// Nearest proper rotation (least squares).
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

/// A 4x4 matrix from a file or a stream as a rigid motion: rounding (|R'R - I| <= 1e-3) is corrected; scale,
/// shear, reflection or a wrong last row is `bad_value`, a non-finite number `not_finite`. `what` begins the
/// message.
Expected<RigidTransform> rigid_transform_from(const Eigen::Matrix4d& matrix, const std::string& what);

}  // namespace helicarm::geometry
