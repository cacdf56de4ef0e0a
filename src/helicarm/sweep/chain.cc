// SPDX-License-Identifier: Apache-2.0
#include "helicarm/sweep/chain.h"

#include <cmath>
#include <limits>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::sweep {

Chain::Chain(std::vector<ChainMatrix> diagonal, std::vector<ChainMatrix> next) : next_(std::move(next)) {
  for (std::size_t i = 0; i < diagonal.size(); ++i) {
    if (i > 0) diagonal[i] -= next_[i - 1].transpose() * inverse_[i - 1] * next_[i - 1];
    // Scaled to a unit diagonal: the parameters' units differ by many orders.
    const ChainVector root = diagonal[i].diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::MatrixXd unit = root.asDiagonal() * diagonal[i] * root.asDiagonal();
    inverse_.emplace_back(root.asDiagonal() * geometry::inverse(unit) * root.asDiagonal());
    log_determinant_ += geometry::log_determinant(unit).value_or(std::numeric_limits<double>::quiet_NaN()) -
                        2 * root.array().log().sum();
  }
}

std::vector<Eigen::MatrixXd> Chain::solve(std::vector<Eigen::MatrixXd> right) const {
  for (std::size_t i = 1; i < right.size(); ++i)
    right[i] -= next_[i - 1].transpose() * (inverse_[i - 1] * right[i - 1]);
  for (std::size_t i = right.size(); i-- > 0;) {
    if (i + 1 < right.size()) right[i] -= next_[i] * right[i + 1];
    right[i] = inverse_[i] * right[i];
  }
  return right;
}

std::vector<ChainMatrix> Chain::covariances() const {
  std::vector<ChainMatrix> covariances = inverse_;
  for (std::size_t i = inverse_.size(); i-- > 1;) {
    const ChainMatrix gain = inverse_[i - 1] * next_[i - 1];
    covariances[i - 1] += gain * covariances[i] * gain.transpose();
  }
  return covariances;
}

}  // namespace helicarm::sweep
