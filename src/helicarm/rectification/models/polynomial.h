// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/rectification/models/linear_model.h"

namespace helicarm::rectification {

/// Both coordinates are polynomials of the same order: all monomials of models/monomials.h. Order 2 is Eq. 1
/// as published.
class PolynomialModel : public LinearModel {
 public:
  PolynomialModel(int order, LinearTerms terms) : LinearModel(std::move(terms)), order_(order) {}

  int order() const { return order_; }
  std::string name() const override;
  void write(Json& json) const override;

 protected:
  Eigen::VectorXd basis(const Eigen::Vector2d& t) const override;
  Eigen::MatrixX2d slopes(const Eigen::Vector2d& t) const override;

 private:
  int order_;
};

/// The coefficients alone, without covariance.
ModelPointer polynomial_model(int order, const Normalisation& normalised,
                              const Eigen::MatrixX2d& coefficients);

LinearFit fit_polynomial(const PlateDots& dots, int order);
/// Largest order that so many dots support, two dots for each term.
int highest_order(Eigen::Index dots);

/// Of models in the order of decreasing simplicity, the last whose held-out error is clearly smaller.
template <class FitOf>
ModelFit simplest_good(int low, int high, const FitOf& fit_of) {
  ModelFit best = fit_of(low);
  for (int order = low + 1; order <= high; ++order)
    if (ModelFit fit = fit_of(order); clearly_better(fit, best)) best = std::move(fit);
  return best;
}

}  // namespace helicarm::rectification
