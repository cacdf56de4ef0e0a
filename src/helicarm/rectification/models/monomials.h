// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace helicarm::rectification {

/// Number of monomials in two variables up to an order.
constexpr Eigen::Index term_count(int order) { return (order + 1) * (order + 2) / 2; }

/// 1, x, y, x^2, xy, y^2, x^3, ...: by degree, falling powers of x.
inline Eigen::VectorXd monomials(const Eigen::Vector2d& t, int order) {
  Eigen::VectorXd terms(term_count(order));
  terms[0] = 1;
  for (int degree = 1, at = 1; degree <= order; ++degree) {
    for (int j = 0; j < degree; ++j, ++at) terms[at] = t.x() * terms[at - degree];
    terms[at] = t.y() * terms[at - degree - 1];
    ++at;
  }
  return terms;
}

/// d/dx and d/dy of the monomials, one row per term.
inline Eigen::MatrixX2d monomial_slopes(const Eigen::Vector2d& t, int order) {
  const Eigen::VectorXd lower = monomials(t, order);
  Eigen::MatrixX2d slopes = Eigen::MatrixX2d::Zero(term_count(order), 2);
  for (int degree = 1, at = 1; degree <= order; ++degree)
    for (int j = 0; j <= degree; ++j, ++at) {
      if (degree > j) slopes(at, 0) = (degree - j) * lower[at - degree];
      if (j > 0) slopes(at, 1) = j * lower[at - degree - 1];
    }
  return slopes;
}

}  // namespace helicarm::rectification
