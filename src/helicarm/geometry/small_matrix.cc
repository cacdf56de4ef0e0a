// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/small_matrix.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace helicarm::geometry {

SymmetricEigen3 symmetric_eigen(const Eigen::Matrix3d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Vector6d symmetric_eigenvalues(const Matrix6d& matrix) {
  return Eigen::SelfAdjointEigenSolver<Matrix6d>(matrix, Eigen::EigenvaluesOnly).eigenvalues();
}

Matrix6d inverse(const Matrix6d& matrix) { return matrix.inverse(); }

double squared_distance(const Eigen::Vector2d& offset, const Eigen::Matrix2d& covariance) {
  return offset.dot(covariance.ldlt().solve(offset));
}

double squared_distance(const Eigen::Vector3d& offset, const Eigen::Matrix3d& covariance) {
  return offset.dot(covariance.ldlt().solve(offset));
}

double squared_distance(const Vector6d& offset, const Matrix6d& covariance) {
  return offset.dot(covariance.ldlt().solve(offset));
}

}  // namespace helicarm::geometry
