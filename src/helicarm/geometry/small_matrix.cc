// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/small_matrix.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::geometry {

template <>
SmallSymmetricEigen<2> symmetric_eigen<2>(const Eigen::Matrix2d& matrix) {
  // Jacobi's rotation: exact in one step.
  const double sum = matrix(0, 0) + matrix(1, 1), difference = matrix(0, 0) - matrix(1, 1);
  const double spread = std::hypot(difference, 2 * matrix(1, 0));
  const double angle = std::atan2(2 * matrix(1, 0), difference) / 2;
  const double c = std::cos(angle), s = std::sin(angle);
  return {{(sum - spread) / 2, (sum + spread) / 2}, (Eigen::Matrix2d() << -s, c, c, s).finished()};
}

template <>
SmallSymmetricEigen<3> symmetric_eigen<3>(const Eigen::Matrix3d& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Vector6d symmetric_eigenvalues(const Matrix6d& matrix) {
  return symmetric_eigen(Eigen::MatrixXd(matrix)).values;
}

double squared_distance(const Eigen::Vector2d& offset, const Eigen::Matrix2d& covariance) {
  return offset.dot(covariance.inverse() * offset);
}

double squared_distance(const Eigen::Vector3d& offset, const Eigen::Matrix3d& covariance) {
  return offset.dot(covariance.ldlt().solve(offset));
}

double squared_distance(const Vector6d& offset, const Matrix6d& covariance) {
  return offset.dot(solve_spd(covariance, offset).solution.col(0));
}

}  // namespace helicarm::geometry
