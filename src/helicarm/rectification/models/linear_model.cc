// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/models/linear_model.h"

#include <algorithm>
#include <cmath>

#include "helicarm/geometry/dense_matrix.h"

namespace helicarm::rectification {

using Eigen::Index;
using Eigen::MatrixX2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;

Vector2d LinearModel::raw_from_rectified(const Vector2d& rectified) const {
  return terms_.coefficients.transpose() * basis(terms_.normalised(rectified));
}

Eigen::Matrix2d LinearModel::jacobian(const Vector2d& rectified) const {
  return terms_.coefficients.transpose() * slopes(terms_.normalised(rectified)) / terms_.normalised.scale;
}

MatrixXd LinearModel::covariance_px2(std::span<const Vector2d> rectified) const {
  if (terms_.covariance.size() == 0) return DistortionModel::covariance_px2(rectified);
  const auto n = static_cast<Index>(rectified.size());
  std::vector<Vector2d> places;
  MatrixXd rows(n, terms_.covariance.rows());
  for (Index i = 0; i < n; ++i) {
    places.push_back(terms_.normalised(rectified[static_cast<std::size_t>(i)]));
    rows.row(i) = basis(places.back());
  }
  MatrixXd covariance = rows * terms_.covariance * rows.transpose();
  for (Index j = 0; j < n; ++j)
    for (Index i = 0; i < n; ++i)
      covariance(i, j) +=
          prior_covariance(places[static_cast<std::size_t>(i)], places[static_cast<std::size_t>(j)]);
  return covariance;
}

Json rows_of(const MatrixXd& matrix) {
  Json rows = Json::array();
  for (Index r = 0; r < matrix.rows(); ++r) {
    Json row = Json::array();
    for (Index c = 0; c < matrix.cols(); ++c) row.push_back(matrix(r, c));
    rows.push_back(std::move(row));
  }
  return rows;
}

MatrixXd matrix_of(JsonReader& reader, const char* key, Index columns, std::size_t max_rows) {
  const Json& value = reader.raw(key);
  const std::size_t rows = value.is_array() ? value.size() : 0;
  if (!value.is_array() || rows > max_rows)
    reader.refuse(Reason::bad_value, key, "is not a list of allowed length");
  const auto numbers = reader.matrix(key, rows, static_cast<std::size_t>(columns), {-1e12, 1e12});
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      numbers.data(), static_cast<Index>(rows), columns);
}

void write_coefficients(const Normalisation& normalised, const MatrixX2d& coefficients, Json& json) {
  json["centre"] = {normalised.centre.x(), normalised.centre.y()};
  json["scale"] = normalised.scale;
  json["coefficients"] = rows_of(coefficients);
}

LinearTerms read_coefficients(JsonReader& reader) {
  const auto centre = reader.numbers("centre", 2, {-1e9, 1e9});
  LinearTerms terms;
  terms.normalised = {{centre[0], centre[1]}, reader.number("scale", {1e-6, 1e6})};
  terms.coefficients = matrix_of(reader, "coefficients", 2, 200);
  return terms;
}

MatrixXd read_covariance(JsonReader& reader, Index terms) {
  if (reader.raw("covariance").empty()) return {};
  MatrixXd covariance = matrix_of(reader, "covariance", terms, 2200);
  if (covariance.rows() != terms) reader.refuse(Reason::bad_value, "covariance", "is not square");
  return covariance;
}

LinearFit fit_linear(const PlateDots& dots, const MatrixXd& rows, const MatrixXd& penalty) {
  const MatrixX2d& raw = dots.raw;
  const Eigen::VectorXd& weights = dots.weights;
  const MatrixXd weighted = weights.asDiagonal() * rows;
  MatrixXd system = geometry::gram(weights.cwiseSqrt().asDiagonal() * rows);
  system.bottomRightCorner(penalty.rows(), penalty.cols()) += penalty;
  const Index size = system.rows();
  MatrixXd right(size, size + 2);
  right << MatrixXd::Identity(size, size), weighted.transpose() * raw;
  const geometry::SpdSolution solved = geometry::solve_spd(system, right);
  LinearFit fit;
  if (!(solved.rcond > 1e-15)) return fit;
  fit.inverse = solved.solution.leftCols(size);
  fit.coefficients = solved.solution.rightCols(2);
  fit.residuals = raw - rows * fit.coefficients;
  const MatrixXd spread = rows * fit.inverse;
  fit.held_out.resize(raw.rows());
  fit.studentized.resize(raw.rows(), 2);
  double sum = 0;
  double total = 0;
  double trace = 0;
  for (Index i = 0; i < raw.rows(); ++i) {
    const double leverage = weights[i] * spread.row(i).dot(rows.row(i));
    trace += leverage;
    if (leverage > 1 - 1e-6) return LinearFit{};
    fit.held_out[i] = fit.residuals.row(i).norm() / (1 - leverage);
    fit.studentized.row(i) = fit.residuals.row(i) / std::sqrt(1 - leverage);
    sum += weights[i] * fit.held_out[i] * fit.held_out[i];
    total += weights[i];
  }
  fit.held_out_rms = std::sqrt(sum / total);
  const double freedom = std::max(1.0, double(raw.rows()) - trace);
  fit.variance = (weights.asDiagonal() * fit.residuals).cwiseProduct(fit.residuals).sum() / (2 * freedom);
  return fit;
}

LinearTerms terms_of(const LinearFit& fit, const Normalisation& normalised) {
  return {normalised, fit.coefficients, fit.variance * fit.inverse};
}

}  // namespace helicarm::rectification
