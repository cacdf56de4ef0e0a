// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/dense_matrix.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

namespace helicarm::geometry {

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(matrix);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

Eigen::MatrixXd gram(const Eigen::MatrixXd& matrix) {
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(matrix.cols(), matrix.cols());
  if (matrix.rows() == 0) return product;  // by which Eigen would divide
  product.selfadjointView<Eigen::Lower>().rankUpdate(matrix.transpose());
  product.triangularView<Eigen::StrictlyUpper>() = product.transpose();
  return product;
}

RightSingular right_singular(const Eigen::MatrixXd& matrix) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(matrix, Eigen::ComputeThinV);
  return {svd.singularValues(), svd.matrixV()};
}

LinearLeastSquares linear_least_squares(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(matrix);
  const Eigen::Index last = std::min(matrix.rows(), matrix.cols()) - 1;
  return {qr.solve(right), qr.rank(), std::abs(qr.matrixR()(last, last)) / qr.maxPivot()};
}

SpdSolution solve_spd(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right) {
  const Eigen::LDLT<Eigen::MatrixXd> factors(matrix);
  // Eigen solves with a pseudo-inverse of D, so rcond() alone does not see a pivot of zero.
  const bool is_positive = factors.info() == Eigen::Success && factors.vectorD().minCoeff() > 0;
  return {factors.solve(right), is_positive ? factors.rcond() : 0.0};
}

std::optional<double> log_determinant(const Eigen::MatrixXd& matrix) {
  const Eigen::LLT<Eigen::MatrixXd> root(matrix);
  if (root.info() != Eigen::Success) return std::nullopt;
  return 2 * root.matrixLLT().diagonal().array().log().sum();
}

Eigen::MatrixXd inverse(const Eigen::MatrixXd& matrix) { return matrix.inverse(); }

Eigen::MatrixXd orthonormal_columns(const Eigen::MatrixXd& matrix) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(matrix).householderQ() *
         Eigen::MatrixXd::Identity(matrix.rows(), matrix.cols());
}

std::optional<Eigen::MatrixXd> whitening(const Eigen::MatrixXd& covariance) {
  const Eigen::LLT<Eigen::MatrixXd> root(covariance);
  if (root.info() != Eigen::Success) return std::nullopt;
  return root.matrixL().solve(Eigen::MatrixXd::Identity(covariance.rows(), covariance.cols()));
}

}  // namespace helicarm::geometry
