// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

/// Least squares whose unknowns fall into blocks that meet only in common ones: the normal matrix is an arrow
/// of blocks on the diagonal and a border, and every operation costs linearly in the number of blocks.
namespace helicarm::geometry {

/// Normal equations of that form, linearised at one state.
struct ArrowEquations {
  struct Block {
    Eigen::MatrixXd information;  ///< of its own unknowns
    Eigen::MatrixXd with_common;  ///< own rows, common columns
    Eigen::VectorXd gradient;     ///< of its own unknowns
  };

  std::vector<Block> blocks;
  Eigen::MatrixXd common;  ///< information of the common unknowns
  Eigen::VectorXd common_gradient;
  double chi2 = 0;

  Eigen::Index unknowns() const;
  /// Blocks in order, then the common unknowns. `damping` is added to the diagonal, relative to it.
  Eigen::VectorXd step(double damping) const;
  /// Decrease of chi2 that the undamped step predicts.
  double decrease(const Eigen::VectorXd& step) const;
};

/// The inverse of the normal matrix: the covariance of the unknowns. With P_ij its blocks, c the common ones:
/// P_cc = `of_common`, P_ic = -response_i P_cc, P_ij = [i = j] own_i + response_i P_cc response_j^T.
struct ArrowCovariance {
  std::vector<Eigen::MatrixXd> own;       ///< with the common unknowns fixed
  std::vector<Eigen::MatrixXd> response;  ///< own unknowns follow the common ones by -response
  Eigen::MatrixXd of_common;
  double log_determinant = 0;
  double rcond = 0;  ///< of the matrix scaled to a unit diagonal, in order of magnitude; 0: not positive

  Eigen::MatrixXd block(std::size_t i, std::size_t j) const;
};

ArrowCovariance inverse(const ArrowEquations& equations);

}  // namespace helicarm::geometry
