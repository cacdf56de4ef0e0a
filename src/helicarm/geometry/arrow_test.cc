// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/arrow.h"

#include <random>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <gtest/gtest.h>

namespace helicarm::geometry {
namespace {

/// Random equations of three blocks, and the same as one matrix.
struct Both {
  ArrowEquations arrow;
  Eigen::MatrixXd dense;
  Eigen::VectorXd gradient;
};

Both equations_of(Eigen::Index common) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto matrix = [&](Eigen::Index rows, Eigen::Index columns) {
    return Eigen::MatrixXd(Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); }));
  };
  const std::vector<Eigen::Index> sizes{3, 5, 4};
  const Eigen::Index all = 12 + common;
  Both both{{}, Eigen::MatrixXd::Zero(all, all), Eigen::VectorXd::Zero(all)};
  both.arrow.common = Eigen::MatrixXd::Identity(common, common);
  both.arrow.common_gradient = Eigen::VectorXd::Zero(common);
  both.dense.bottomRightCorner(common, common).setIdentity();
  Eigen::Index at = 0;
  for (const Eigen::Index size : sizes) {
    const Eigen::MatrixXd own = matrix(9, size), shared = matrix(9, common);
    const Eigen::VectorXd residuals = matrix(9, 1);
    both.arrow.blocks.push_back(
        {own.transpose() * own, own.transpose() * shared, own.transpose() * residuals});
    both.arrow.common += shared.transpose() * shared;
    both.arrow.common_gradient += shared.transpose() * residuals;
    Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(9, all);
    rows.middleCols(at, size) = own;
    rows.rightCols(common) = shared;
    both.dense += rows.transpose() * rows;
    both.gradient += rows.transpose() * residuals;
    at += size;
  }
  return both;
}

TEST(Arrow, StepIsThatOfTheWholeMatrix) {
  for (const Eigen::Index common : {0, 2}) {
    const Both both = equations_of(common);
    Eigen::MatrixXd damped = both.dense;
    damped.diagonal() *= 1.1;
    const Eigen::VectorXd expected = damped.ldlt().solve(both.gradient);
    const Eigen::VectorXd step = both.arrow.step(0.1);
    EXPECT_LT((step - expected).norm(), 1e-12 * expected.norm());
    EXPECT_NEAR(both.arrow.decrease(step), both.gradient.dot(expected), 1e-9);
  }
}

TEST(Arrow, CovarianceIsTheInverseOfTheWholeMatrix) {
  for (const Eigen::Index common : {0, 2}) {
    const Both both = equations_of(common);
    const Eigen::MatrixXd expected = both.dense.inverse();
    const ArrowCovariance covariance = inverse(both.arrow);
    EXPECT_LT((covariance.block(0, 0) - expected.block(0, 0, 3, 3)).norm(), 1e-12);
    EXPECT_LT((covariance.block(1, 2) - expected.block(3, 8, 5, 4)).norm(), 1e-12);
    EXPECT_LT((covariance.of_common - expected.bottomRightCorner(common, common)).norm(), 1e-12);
    EXPECT_LT((-covariance.response[1] * covariance.of_common - expected.block(3, 12, 5, common)).norm(),
              1e-12);
    EXPECT_NEAR(covariance.log_determinant, std::log(expected.determinant()), 1e-9);
    EXPECT_GT(covariance.rcond, 1e-3);
  }
}

TEST(Arrow, CommonUnknownsThatNothingDeterminesHaveNoRcond) {
  Both both = equations_of(2);
  ArrowEquations& arrow = both.arrow;
  for (ArrowEquations::Block& block : arrow.blocks) block.with_common.col(1) = block.with_common.col(0);
  arrow.common.col(1) = arrow.common.col(0);
  arrow.common.row(1) = arrow.common.row(0);
  EXPECT_LT(inverse(arrow).rcond, 1e-12);
}

}  // namespace
}  // namespace helicarm::geometry
