// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/dense_matrix.h"

#include <cmath>

#include <Eigen/LU>
#include <gtest/gtest.h>

namespace helicarm::geometry {
namespace {

Eigen::MatrixXd tall_matrix() {
  Eigen::MatrixXd matrix(5, 3);
  matrix << 4, 1, -2, 0.5, 1, 3, 0, 2, -2, 0, -1, 1, 0.5, 2, 1;
  return matrix;
}

TEST(SymmetricEigen, AscendingValuesAndOrthonormalVectorsRebuildTheMatrix) {
  Eigen::Matrix4d matrix;
  matrix << 4, 1, -2, 0.5, 1, 3, 0, 2, -2, 0, -1, 1, 0.5, 2, 1, 0;
  const auto [values, vectors] = symmetric_eigen(matrix);
  for (Eigen::Index k = 1; k < 4; ++k) EXPECT_LT(values[k - 1], values[k]);
  EXPECT_TRUE((vectors.transpose() * vectors).isIdentity(1e-14));
  EXPECT_TRUE((vectors * values.asDiagonal() * vectors.transpose()).isApprox(matrix, 1e-14));
}

TEST(Gram, IsTheProductOfTheTransposeAndTheMatrix) {
  const Eigen::MatrixXd matrix = tall_matrix();
  EXPECT_TRUE(gram(matrix).isApprox(matrix.transpose() * matrix, 1e-14));
}

TEST(Gram, OfNoRowsIsZero) { EXPECT_EQ(gram(Eigen::MatrixXd(0, 3)), Eigen::MatrixXd::Zero(3, 3)); }

TEST(RightSingular, DescendingValuesAndOrthonormalVectorsRebuildTheNormalMatrix) {
  const Eigen::MatrixXd matrix = tall_matrix();
  const auto [values, vectors] = right_singular(matrix);
  for (Eigen::Index k = 1; k < 3; ++k) EXPECT_GT(values[k - 1], values[k]);
  EXPECT_TRUE((vectors.transpose() * vectors).isIdentity(1e-14));
  EXPECT_TRUE((vectors * values.cwiseAbs2().asDiagonal() * vectors.transpose())
                  .isApprox(matrix.transpose() * matrix, 1e-14));
}

TEST(LinearLeastSquares, ResidualIsOrthogonalToTheColumns) {
  const Eigen::MatrixXd matrix = tall_matrix();
  const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(5, -1, 3);
  const auto [solution, rank, last_pivot] = linear_least_squares(matrix, right);
  EXPECT_EQ(rank, 3);
  EXPECT_GT(last_pivot, 0.1);
  EXPECT_LT((matrix.transpose() * (right - matrix * solution)).norm(), 1e-13);
}

TEST(LinearLeastSquares, DependentColumnsLowerTheRank) {
  Eigen::MatrixXd matrix = tall_matrix();
  matrix.col(2) = matrix.col(0) - matrix.col(1);
  const auto [solution, rank, last_pivot] = linear_least_squares(matrix, Eigen::VectorXd::Ones(5));
  EXPECT_EQ(rank, 2);
  EXPECT_LT(last_pivot, 1e-14);
}

TEST(SolveSpd, SolvesAndEstimatesTheCondition) {
  const Eigen::MatrixXd matrix = tall_matrix().transpose() * tall_matrix();
  const auto [solution, rcond] = solve_spd(matrix, Eigen::MatrixXd::Identity(3, 3));
  EXPECT_TRUE((matrix * solution).isIdentity(1e-13));
  EXPECT_GT(rcond, 0.01);
}

TEST(SolveSpd, SingularMatrixHasNoCondition) {
  EXPECT_EQ(solve_spd(Eigen::MatrixXd::Ones(3, 3), Eigen::MatrixXd::Identity(3, 3)).rcond, 0);
}

TEST(SolveSpd, IndefiniteMatrixHasNoCondition) {
  EXPECT_EQ(solve_spd((Eigen::MatrixXd(2, 2) << 1, 2, 2, 1).finished(), Eigen::VectorXd::Ones(2)).rcond, 0);
}

TEST(OrthonormalColumns, SpanTheColumns) {
  const Eigen::MatrixXd columns = orthonormal_columns(tall_matrix());
  ASSERT_EQ(columns.cols(), 3);
  EXPECT_TRUE((columns.transpose() * columns).isIdentity(1e-14));
  EXPECT_TRUE((columns * (columns.transpose() * tall_matrix())).isApprox(tall_matrix(), 1e-14));
}

TEST(Whitening, WhitensTheCovariance) {
  const Eigen::MatrixXd covariance = tall_matrix().transpose() * tall_matrix();
  const auto whitens = whitening(covariance);
  ASSERT_TRUE(whitens);
  EXPECT_TRUE((*whitens * covariance * whitens->transpose()).isIdentity(1e-13));
}

TEST(Whitening, IndefiniteCovarianceHasNone) {
  EXPECT_FALSE(whitening((Eigen::MatrixXd(2, 2) << 1, 2, 2, 1).finished()));
}

TEST(LogDeterminant, IsThatOfAPositiveMatrixAndNothingOfAnother) {
  const Eigen::MatrixXd positive = gram(tall_matrix());
  EXPECT_NEAR(*log_determinant(positive), std::log(positive.determinant()), 1e-12);
  EXPECT_FALSE(log_determinant(-positive));
}

TEST(Inverse, TimesTheMatrixIsOne) {
  const Eigen::MatrixXd matrix = gram(tall_matrix());
  EXPECT_TRUE((inverse(matrix) * matrix).isIdentity(1e-12));
}

}  // namespace
}  // namespace helicarm::geometry
