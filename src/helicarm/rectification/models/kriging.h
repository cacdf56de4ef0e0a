// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/rectification/models/polynomial.h"

namespace helicarm::rectification {

/// A polynomial trend and a smooth remainder: Matern kernels at knots (universal kriging).
struct Trend {
  int order = 0;           ///< of the polynomial; 0: the identity
  LinearTerms terms;       ///< monomials, then kernels
  Eigen::MatrixX2d knots;  ///< m x 2, normalised; none: the polynomial alone
  double length = 0;       ///< of the kernel, normalised
  double sigma_px = 0;     ///< prior standard deviation of the remainder per axis
};

/// C is the reduction of the remainder's prior variance by the dots: far from them that variance applies.
class KrigingModel : public PolynomialModel {
 public:
  explicit KrigingModel(Trend trend)
      : PolynomialModel(trend.order, trend.terms),
        knots_(std::move(trend.knots)),
        length_(trend.length),
        sigma_px_(trend.sigma_px) {}

  std::string name() const override { return PolynomialModel::name() + ", smooth remainder"; }
  void write(Json& json) const override;

 protected:
  Eigen::VectorXd basis(const Eigen::Vector2d& t) const override;
  Eigen::MatrixX2d slopes(const Eigen::Vector2d& t) const override;
  double prior_covariance(const Eigen::Vector2d& p, const Eigen::Vector2d& q) const override;

 private:
  Eigen::MatrixX2d knots_;
  double length_;
  double sigma_px_;
};

/// Matern covariance of smoothness 3/2: matches the roughness of real screens between dots.
double kernel(double squared_distance, double length);

/// Passes through dots without noise; without covariance.
Trend trend_through(const PlateDots& dots, int order);

/// Keys of map.json that identity, polynomial and kriging share.
void write_trend(const Trend& trend, Json& json);
ModelPointer read_trend(JsonReader& reader);

}  // namespace helicarm::rectification
