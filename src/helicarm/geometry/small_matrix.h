// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

/// Decompositions of small matrices, each compiled once, as those of dense_matrix.h.
namespace helicarm::geometry {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Eigenvalues, ascending, and unit eigenvectors, the columns.
struct SymmetricEigen3 {
  Eigen::Vector3d values;
  Eigen::Matrix3d vectors;
};

/// Of a symmetric matrix, of which the lower triangle is read.
SymmetricEigen3 symmetric_eigen(const Eigen::Matrix3d& matrix);

/// Likewise, ascending.
Vector6d symmetric_eigenvalues(const Matrix6d& matrix);

/// Of any regular matrix.
Matrix6d inverse(const Matrix6d& matrix);

/// Squared Mahalanobis distance: offset^T covariance^-1 offset.
double squared_distance(const Eigen::Vector2d& offset, const Eigen::Matrix2d& covariance);
double squared_distance(const Eigen::Vector3d& offset, const Eigen::Matrix3d& covariance);
double squared_distance(const Vector6d& offset, const Matrix6d& covariance);

}  // namespace helicarm::geometry
