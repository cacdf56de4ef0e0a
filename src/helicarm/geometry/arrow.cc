// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/arrow.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::geometry {
namespace {

Eigen::MatrixXd damped(Eigen::MatrixXd information, double damping) {
  information.diagonal() *= 1 + damping;
  return information;
}

/// Both triangles, of a matrix that is symmetric but for rounding.
Eigen::MatrixXd symmetric(const Eigen::MatrixXd& matrix) { return (matrix + matrix.transpose()) / 2; }

struct Inverse {
  Eigen::MatrixXd matrix;
  Eigen::MatrixXd solution;  ///< of the information's equations
  double log_determinant;    ///< of the inverse
  double rcond;              ///< with the diagonal's units `unit`
};

/// Scaled by the diagonal of `unit`, so that unknowns of any size count alike. The equations of `right` are
/// solved beside it: a product with the inverse has its errors.
Inverse scaled_inverse(const Eigen::MatrixXd& information, const Eigen::VectorXd& unit,
                       const Eigen::MatrixXd& right) {
  const Eigen::VectorXd root = unit.cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = root.asDiagonal() * information * root.asDiagonal();
  Eigen::MatrixXd sides(scaled.rows(), scaled.cols() + right.cols());
  sides.leftCols(scaled.cols()).setIdentity();
  sides.rightCols(right.cols()) = root.asDiagonal() * right;
  const auto [solution, rcond] = solve_spd(scaled, sides);
  const double size = std::min(1.0, scaled.diagonal().cwiseAbs().maxCoeff());
  const Eigen::MatrixXd matrix =
      root.asDiagonal() * symmetric(solution.leftCols(scaled.cols())) * root.asDiagonal();
  const double log_determinant =
      -2 * scaled.llt().matrixLLT().diagonal().array().log().sum() + 2 * root.array().log().sum();
  return {matrix, root.asDiagonal() * solution.rightCols(right.cols()), log_determinant, rcond * size};
}

}  // namespace

Eigen::Index ArrowEquations::unknowns() const {
  Eigen::Index count = common_gradient.size();
  for (const Block& block : blocks) count += block.gradient.size();
  return count;
}

Eigen::VectorXd ArrowEquations::step(double damping) const {
  const Eigen::Index columns = common_gradient.size();
  Eigen::MatrixXd reduced = damped(common, damping);
  Eigen::VectorXd gradient = common_gradient;
  std::vector<Eigen::MatrixXd> solved;  // of [with_common, gradient]
  for (const Block& block : blocks) {
    Eigen::MatrixXd right(block.gradient.size(), columns + 1);
    right << block.with_common, block.gradient;
    solved.push_back(solve_spd(damped(block.information, damping), right).solution);
    reduced -= block.with_common.transpose() * solved.back().leftCols(columns);
    gradient -= block.with_common.transpose() * solved.back().col(columns);
  }
  Eigen::VectorXd step(unknowns());
  if (columns > 0) step.tail(columns) = solve_spd(symmetric(reduced), gradient).solution;
  Eigen::Index at = 0;
  for (const Eigen::MatrixXd& one : solved) {
    step.segment(at, one.rows()) = one.col(columns) - one.leftCols(columns) * step.tail(columns);
    at += one.rows();
  }
  return step;
}

double ArrowEquations::decrease(const Eigen::VectorXd& step) const {
  double sum = common_gradient.dot(step.tail(common_gradient.size()));
  Eigen::Index at = 0;
  for (const Block& block : blocks) {
    sum += block.gradient.dot(step.segment(at, block.gradient.size()));
    at += block.gradient.size();
  }
  return sum;
}

Eigen::MatrixXd ArrowCovariance::block(std::size_t i, std::size_t j) const {
  Eigen::MatrixXd between = response[i] * of_common * response[j].transpose();
  if (i == j) between += own[i];
  return between;
}

ArrowCovariance inverse(const ArrowEquations& equations) {
  ArrowCovariance covariance;
  covariance.rcond = 1;
  Eigen::MatrixXd reduced = equations.common;
  for (const ArrowEquations::Block& block : equations.blocks) {
    const Inverse own = scaled_inverse(block.information, block.information.diagonal(), block.with_common);
    covariance.own.push_back(own.matrix);
    covariance.response.push_back(own.solution);
    covariance.log_determinant += own.log_determinant;
    covariance.rcond = std::min(covariance.rcond, own.rcond);
    reduced -= block.with_common.transpose() * covariance.response.back();
  }
  covariance.of_common.resize(reduced.rows(), reduced.cols());
  if (reduced.rows() == 0) return covariance;
  const Inverse common =
      scaled_inverse(symmetric(reduced), equations.common.diagonal(), Eigen::MatrixXd(reduced.rows(), 0));
  covariance.of_common = common.matrix;
  covariance.log_determinant += common.log_determinant;
  covariance.rcond = std::min(covariance.rcond, common.rcond);
  return covariance;
}

}  // namespace helicarm::geometry
