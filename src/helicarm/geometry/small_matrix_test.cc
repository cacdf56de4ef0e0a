// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/small_matrix.h"

#include <initializer_list>

#include <gtest/gtest.h>

#include "helicarm/core/random.h"
#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::geometry {
namespace small_matrix_test {

/// Symmetric, positive definite.
template <int n>
Eigen::Matrix<double, n, n> drawn() {
  RandomStream random(5, n);
  Eigen::Matrix<double, n, n> any;
  for (double& value : any.reshaped()) value = random.normal();
  return any * any.transpose() + 0.1 * Eigen::Matrix<double, n, n>::Identity();
}

TEST(SmallMatrix, EigenvaluesAndVectorsMakeTheMatrix) {
  const Eigen::Matrix3d matrix = drawn<3>();
  const auto found = symmetric_eigen(matrix);
  EXPECT_LT((found.vectors * found.values.asDiagonal() * found.vectors.transpose() - matrix).norm(), 1e-12);
  EXPECT_LT(found.values[0], found.values[1]);
  EXPECT_LT(found.values[1], found.values[2]);
}

TEST(SmallMatrix, EigenvaluesOfSixAreThoseOfAnySize) {
  const Matrix6d matrix = drawn<6>();
  EXPECT_LT((symmetric_eigenvalues(matrix) - symmetric_eigen(Eigen::MatrixXd(matrix)).values).norm(), 1e-12);
}

TEST(SmallMatrix, EigenvaluesAndVectorsOfTwoMakeTheMatrix) {
  const Eigen::Matrix2d plain = drawn<2>(), diagonal = Eigen::Vector2d(3, -1).asDiagonal();
  for (const Eigen::Matrix2d& matrix : std::initializer_list<Eigen::Matrix2d>{
           plain, -plain, diagonal, 2 * Eigen::Matrix2d::Identity(), Eigen::Matrix2d::Zero()}) {
    const auto found = symmetric_eigen(matrix);
    EXPECT_LT((found.vectors * found.values.asDiagonal() * found.vectors.transpose() - matrix).norm(), 1e-12);
    EXPECT_LT((found.vectors.transpose() * found.vectors - Eigen::Matrix2d::Identity()).norm(), 1e-12);
    EXPECT_LE(found.values[0], found.values[1]);
  }
}

TEST(SmallMatrix, SquaredDistanceIsThatOfTheWhitenedOffset) {
  const auto by_whitening = [](const Eigen::VectorXd& offset, const Eigen::MatrixXd& covariance) {
    return (*whitening(covariance) * offset).squaredNorm();
  };
  const Eigen::Vector2d two(1, -2);
  const Eigen::Vector3d three(1, -2, 3);
  const Vector6d six = Vector6d::LinSpaced(-1, 4);
  EXPECT_NEAR(squared_distance(two, drawn<2>()), by_whitening(two, drawn<2>()), 1e-9);
  EXPECT_NEAR(squared_distance(three, drawn<3>()), by_whitening(three, drawn<3>()), 1e-9);
  EXPECT_NEAR(squared_distance(six, drawn<6>()), by_whitening(six, drawn<6>()), 1e-9);
}

}  // namespace small_matrix_test
}  // namespace helicarm::geometry
