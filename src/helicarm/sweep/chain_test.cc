// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/chain.h"

#include <cmath>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

namespace helicarm::sweep {
namespace {

/// A chain of four nodes, positive definite, and the same as one matrix.
struct Example {
  std::vector<ChainMatrix> diagonal, next;
  Eigen::MatrixXd dense;
};

Example example() {
  constexpr int nodes = 4;
  std::srand(3);
  Eigen::MatrixXd root = Eigen::MatrixXd::Zero(nodes * chain_size, nodes * chain_size);
  for (int i = 0; i < nodes; ++i) {
    root.block<chain_size, chain_size>(i * chain_size, i * chain_size) =
        4 * ChainMatrix::Identity() + ChainMatrix::Random();
    if (i > 0)
      root.block<chain_size, chain_size>(i * chain_size, (i - 1) * chain_size) = ChainMatrix::Random();
  }
  Example made{{}, {}, root * root.transpose()};
  for (int i = 0; i < nodes; ++i) {
    made.diagonal.emplace_back(made.dense.block<chain_size, chain_size>(i * chain_size, i * chain_size));
    if (i + 1 < nodes)
      made.next.emplace_back(made.dense.block<chain_size, chain_size>(i * chain_size, (i + 1) * chain_size));
  }
  return made;
}

TEST(Chain, SolvesAndInvertsAsTheDenseMatrix) {
  const Example e = example();
  const Chain chain(e.diagonal, e.next);
  const Eigen::LLT<Eigen::MatrixXd> llt(e.dense);
  EXPECT_NEAR(chain.log_determinant(), 2 * llt.matrixLLT().diagonal().array().log().sum(), 1e-9);
  const Eigen::MatrixXd right = Eigen::MatrixXd::Random(e.dense.rows(), 2), solution = llt.solve(right);
  const Eigen::MatrixXd inverse = llt.solve(Eigen::MatrixXd::Identity(e.dense.rows(), e.dense.rows()));
  std::vector<Eigen::MatrixXd> blocks;
  for (std::size_t i = 0; i < e.diagonal.size(); ++i)
    blocks.emplace_back(right.middleRows(Eigen::Index(i) * chain_size, chain_size));
  const auto solved = chain.solve(blocks);
  const auto covariances = chain.covariances();
  for (std::size_t i = 0; i < e.diagonal.size(); ++i) {
    const Eigen::Index at = Eigen::Index(i) * chain_size;
    EXPECT_LT((solved[i] - solution.middleRows(at, chain_size)).cwiseAbs().maxCoeff(), 1e-10);
    EXPECT_LT((covariances[i] - inverse.block<chain_size, chain_size>(at, at)).cwiseAbs().maxCoeff(), 1e-10);
  }
}

}  // namespace
}  // namespace helicarm::sweep
