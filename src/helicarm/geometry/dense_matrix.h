// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <Eigen/Core>

/// Decompositions of matrices of any size, each compiled once: Eigen's own take seconds of each unit that
/// names them.
namespace helicarm::geometry {

/// Eigenvalues, ascending, and unit eigenvectors, the columns.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};

/// Of a symmetric matrix, of which the lower triangle is read.
SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& matrix);

/// A^T A, at half the cost of the product.
Eigen::MatrixXd gram(const Eigen::MatrixXd& matrix);

/// Singular values, descending, and right singular vectors, the columns.
struct RightSingular {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};

/// Of a matrix with at least as many rows as columns.
RightSingular right_singular(const Eigen::MatrixXd& matrix);

/// A linear least-squares problem solved by QR with column pivoting.
struct LinearLeastSquares {
  Eigen::MatrixXd solution;
  Eigen::Index rank;
  double last_pivot;  ///< over the largest
};

/// The X of least |matrix X - right|, column by column.
LinearLeastSquares linear_least_squares(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right);

struct SpdSolution {
  Eigen::MatrixXd solution;
  double rcond;  ///< estimate of the reciprocal condition number; 0 where the matrix is not positive
};

/// X of matrix X = right, with a symmetric positive definite matrix.
SpdSolution solve_spd(const Eigen::MatrixXd& matrix, const Eigen::MatrixXd& right);

/// Of a symmetric positive definite matrix; nothing if it is not.
std::optional<double> log_determinant(const Eigen::MatrixXd& matrix);

Eigen::MatrixXd inverse(const Eigen::MatrixXd& matrix);

/// Orthonormal columns that span those of a matrix with at least as many rows as columns.
Eigen::MatrixXd orthonormal_columns(const Eigen::MatrixXd& matrix);

/// L^-1 of the Cholesky factor L: it whitens values of this covariance. Nothing if it is not positive
/// definite.
std::optional<Eigen::MatrixXd> whitening(const Eigen::MatrixXd& covariance);

}  // namespace helicarm::geometry
