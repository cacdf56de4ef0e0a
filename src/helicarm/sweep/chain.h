// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <Eigen/Core>

namespace helicarm::sweep {

/// A number of nine parameters and its rate of change.
inline constexpr int chain_size = 18;
using ChainMatrix = Eigen::Matrix<double, chain_size, chain_size>;
using ChainVector = Eigen::Matrix<double, chain_size, 1>;

/// A Gaussian Markov chain in information form: a block tridiagonal matrix, factored once in time linear in
/// its length.
class Chain {
 public:
  /// `diagonal`: a block per node; `next`: the block of each node but the last with its successor. Every
  /// leading block must be positive definite.
  Chain(std::vector<ChainMatrix> diagonal, std::vector<ChainMatrix> next);

  double log_determinant() const { return log_determinant_; }

  /// The solution for right sides of any number of columns, 18 rows a node.
  std::vector<Eigen::MatrixXd> solve(std::vector<Eigen::MatrixXd> right) const;

  /// Of each node: its block of the inverse.
  std::vector<ChainMatrix> covariances() const;

 private:
  std::vector<ChainMatrix> inverse_;  ///< of the pivots
  std::vector<ChainMatrix> next_;
  double log_determinant_ = 0;
};

}  // namespace helicarm::sweep
