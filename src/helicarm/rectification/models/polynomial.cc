// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/models/polynomial.h"

#include <fmt/format.h>

#include "helicarm/rectification/models/kriging.h"
#include "helicarm/rectification/models/monomials.h"

namespace helicarm::rectification {
namespace {

using Eigen::MatrixX2d;
using Eigen::Vector2d;

class IdentityModel : public PolynomialModel {
 public:
  IdentityModel() : PolynomialModel(0, {{}, MatrixX2d(0, 2), {}}) {}
  std::string name() const override { return "identity"; }
  bool is_identity() const override { return true; }
  Vector2d raw_from_rectified(const Vector2d& rectified) const override { return rectified; }
  Eigen::Matrix2d jacobian(const Vector2d&) const override { return Eigen::Matrix2d::Identity(); }
  std::optional<Vector2d> rectified_from_raw(const Vector2d& raw) const override { return raw; }
};

ModelFit fit_order(const PlateDots& dots, int order) {
  const LinearFit fit = fit_polynomial(dots, order);
  if (fit.coefficients.size() == 0) return {};
  return {std::make_shared<PolynomialModel>(order, terms_of(fit, dots.normalised)), fit.held_out,
          fit.held_out_rms};
}

ModelFit polynomial_fit(const PlateDots& dots, std::optional<int> order) {
  if (order) return fit_order(dots, *order);
  return simplest_good(1, highest_order(dots.raw.rows()), [&](int o) { return fit_order(dots, o); });
}

}  // namespace

Eigen::VectorXd PolynomialModel::basis(const Vector2d& t) const { return monomials(t, order_); }

MatrixX2d PolynomialModel::slopes(const Vector2d& t) const { return monomial_slopes(t, order_); }

std::string PolynomialModel::name() const { return fmt::format("polynomial of order {}", order_); }

void PolynomialModel::write(Json& json) const { write_trend({order_, terms(), MatrixX2d(0, 2), 0, 0}, json); }

ModelPointer identity_model() {
  static const auto identity = std::make_shared<const IdentityModel>();
  return identity;
}

ModelPointer polynomial_model(int order, const Normalisation& normalised, const MatrixX2d& coefficients) {
  return std::make_shared<PolynomialModel>(order, LinearTerms{normalised, coefficients, {}});
}

LinearFit fit_polynomial(const PlateDots& dots, int order) {
  return fit_linear(dots, rows_for(dots, [&](const Vector2d& t) { return monomials(t, order); }));
}

int highest_order(Eigen::Index dots) {
  int highest = 1;
  while (highest < 7 && 2 * term_count(highest + 1) <= dots) ++highest;
  return highest;
}

ModelKind polynomial_kind() { return {"polynomial", 0, polynomial_fit, read_trend}; }

}  // namespace helicarm::rectification
