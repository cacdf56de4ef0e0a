// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

/// Decompositions of small matrices, each compiled once. Larger ones are dense_matrix.h's: a microsecond more
/// than of a fixed size, for seconds less of the compiler.
namespace helicarm::geometry {

using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector6d = Eigen::Matrix<double, 6, 1>;

/// Eigenvalues, ascending, and unit eigenvectors, the columns.
template <int n>
struct SmallSymmetricEigen {
  Eigen::Matrix<double, n, 1> values;
  Eigen::Matrix<double, n, n> vectors;
};

/// Of a symmetric matrix, of which the lower triangle is read. Expressions take that of dense_matrix.h.
template <int n>
requires(n == 2 || n == 3) SmallSymmetricEigen<n> symmetric_eigen(const Eigen::Matrix<double, n, n>& matrix);

template <>
SmallSymmetricEigen<2> symmetric_eigen<2>(const Eigen::Matrix2d& matrix);
template <>
SmallSymmetricEigen<3> symmetric_eigen<3>(const Eigen::Matrix3d& matrix);

/// Likewise, ascending.
Vector6d symmetric_eigenvalues(const Matrix6d& matrix);

/// Squared Mahalanobis distance: offset^T covariance^-1 offset.
double squared_distance(const Eigen::Vector2d& offset, const Eigen::Matrix2d& covariance);
double squared_distance(const Eigen::Vector3d& offset, const Eigen::Matrix3d& covariance);
double squared_distance(const Vector6d& offset, const Matrix6d& covariance);

}  // namespace helicarm::geometry
