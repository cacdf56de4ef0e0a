// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <Eigen/Core>

#include "helicarm/core/failure.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm {

/// Angles of Eq. 5, radians. Where beta is +-90 degrees only one sum of alpha and gamma is fixed: gamma is
/// then 0 and the angles are marked as locked.
struct EulerAngles {
  double alpha = 0;
  double beta = 0;
  double gamma = 0;
  bool gimbal_locked = false;
};

/// Eq. 5 with r13 = -CaSbCg + SaSg; as printed (SbSg) it is no rotation.
Eigen::Matrix3d rotation_from_euler(double alpha, double beta, double gamma);

/// Inverse of `rotation_from_euler`, beta in [-90, 90] degrees.
EulerAngles euler_from_rotation(const Eigen::Matrix3d& rotation);

/// v x p = cross_matrix(v) * p.
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& vector);

/// Rotation about `vector` by its length (rad), and back; the length returned is at most pi.
Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& vector);
Eigen::Vector3d vector_from_rotation(const Eigen::Matrix3d& rotation);

/// The proper rotation nearest to a matrix (least squares).
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix);

/// A 4x4 from a file or a stream as a rigid motion: rounding (|R'R - I| <= 1e-3) is corrected, anything else
/// is `bad_value` (scale, shear, mirror, last row) or `not_finite`. `what` begins the message.
Expected<RigidTransform> rigid_transform_from(const Eigen::Matrix4d& matrix, const std::string& what);

}  // namespace helicarm
