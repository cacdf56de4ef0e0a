// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/rectification/distortion_model.h"

namespace helicarm::rectification {

/// What all models share that are linear in their coefficients.
struct LinearTerms {
  Normalisation normalised;
  Eigen::MatrixX2d coefficients;  ///< terms x 2, px
  Eigen::MatrixXd covariance;     ///< C, terms x terms, per axis, px^2; empty: taken as exact
};

/// raw = coefficients' b(t) with b the terms at the normalised position t. Its covariance between p and q is
/// prior_covariance(p, q) + b(p)' C b(q).
class LinearModel : public DistortionModel {
 public:
  explicit LinearModel(LinearTerms terms) : terms_(std::move(terms)) {}

  Eigen::Vector2d raw_from_rectified(const Eigen::Vector2d& rectified) const override;
  Eigen::Matrix2d jacobian(const Eigen::Vector2d& rectified) const override;
  double extent_px() const override { return terms_.normalised.scale; }
  Eigen::MatrixXd covariance_px2(std::span<const Eigen::Vector2d> rectified) const override;

 protected:
  virtual Eigen::VectorXd basis(const Eigen::Vector2d& t) const = 0;
  /// d basis / d t, terms x 2.
  virtual Eigen::MatrixX2d slopes(const Eigen::Vector2d& t) const = 0;
  virtual double prior_covariance(const Eigen::Vector2d&, const Eigen::Vector2d&) const { return 0; }
  const LinearTerms& terms() const { return terms_; }

 private:
  LinearTerms terms_;
};

/// "centre", "scale", "coefficients".
void write_coefficients(const Normalisation& normalised, const Eigen::MatrixX2d& coefficients, Json& json);
LinearTerms read_coefficients(JsonReader& reader);
/// "covariance" of so many terms; absent, null or [] is 0 x 0.
Eigen::MatrixXd read_covariance(JsonReader& reader, Eigen::Index terms);
Json rows_of(const Eigen::MatrixXd& matrix);
Eigen::MatrixXd matrix_of(JsonReader& reader, const char* key, Eigen::Index columns, std::size_t max_rows);

/// Weighted (and, for kernels, penalised) linear least squares with leave-one-out residuals.
struct LinearFit {
  Eigen::MatrixX2d coefficients;  ///< none if the dots do not determine them
  Eigen::MatrixX2d residuals;
  double held_out_rms = std::numeric_limits<double>::infinity();
  Eigen::VectorXd held_out;      ///< distance per dot
  Eigen::MatrixX2d studentized;  ///< residual over the root of the dot's redundancy, px
  double variance = 0;           ///< of a dot of weight one according to the residuals, px^2
  Eigen::MatrixXd inverse;       ///< of the normal matrix
};

/// `rows`: b(t) of each dot (n x terms); `penalty` (none: 0 x 0) applies to the last coefficients.
LinearFit fit_linear(const PlateDots& dots, const Eigen::MatrixXd& rows, const Eigen::MatrixXd& penalty = {});

template <class Basis>
Eigen::MatrixXd rows_for(const PlateDots& dots, const Basis& basis) {
  Eigen::MatrixXd rows;
  for (Eigen::Index i = 0; i < dots.raw.rows(); ++i) {
    const Eigen::VectorXd row = basis(dots.points[static_cast<std::size_t>(i)]);
    if (i == 0) rows.resize(dots.raw.rows(), row.size());
    rows.row(i) = row.transpose();
  }
  return rows;
}

/// The coefficients with their covariance from the residuals.
LinearTerms terms_of(const LinearFit& fit, const Normalisation& normalised);

}  // namespace helicarm::rectification
