// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/map_field.h"

#include <algorithm>
#include <cmath>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/rectification/models/kriging.h"
#include "helicarm/rectification/models/monomials.h"

namespace helicarm::rectification {

using Eigen::Index;
using Eigen::MatrixX2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;

namespace {

MatrixXd monomial_rows(const MapField& field) {
  MatrixXd rows(Index(field.places.size()), term_count(field_order));
  for (Index i = 0; i < rows.rows(); ++i)
    rows.row(i) = monomials(field.normalised(field.places[std::size_t(i)]), field_order);
  return rows;
}

}  // namespace

MatrixXd MapField::polynomials() const { return monomial_rows(*this) * from_monomials.transpose(); }

std::vector<int> polynomial_degrees() {
  std::vector<int> degrees;
  for (int degree = 0; degree <= field_order; ++degree)
    for (int k = 0; k <= degree; ++k) degrees.push_back(degree);
  return degrees;
}

MapField field_of(std::span<const DistortionMap> maps, double radius_px) {
  constexpr int steps = 22;
  Vector2d low = maps.front().hull_low, high = maps.front().hull_high;
  for (const DistortionMap& map : maps) {
    low = low.cwiseMin(map.hull_low);
    high = high.cwiseMax(map.hull_high);
  }
  MapField field;
  field.normalised = {0.5 * (low + high), 0.5 * (high - low).maxCoeff()};
  for (int row = 0; row <= steps; ++row)
    for (int column = 0; column <= steps; ++column) {
      const Vector2d share(double(column) / steps, double(row) / steps);
      const Vector2d place = low + share.cwiseProduct(high - low);
      if ((place - field.normalised.centre).norm() <= radius_px) field.places.push_back(place);
    }
  const MatrixXd rows = monomial_rows(field);
  // Of a lower triangular root: a polynomial of a degree holds no monomials of higher ones.
  field.from_monomials = geometry::whitening(geometry::gram(rows) / double(rows.rows())).value();
  return field;
}

MatrixX2d displacements(const DistortionMap& map, const MapField& field) {
  MatrixX2d off(Index(field.places.size()), 2);
  for (Index i = 0; i < off.rows(); ++i) {
    const Vector2d& place = field.places[std::size_t(i)];
    off.row(i) = map.raw_from_rectified(place) - place;
  }
  return off;
}

DistortionMap map_through(const MapField& field, const MatrixX2d& displacements,
                          const MapVariation& variation, double factor, const DistortionMap& like) {
  PlateDots dots;
  dots.normalised = field.normalised;
  dots.raw = displacements;
  for (Index i = 0; i < dots.raw.rows(); ++i) {
    const Vector2d& place = field.places[std::size_t(i)];
    dots.points.push_back(field.normalised(place));
    dots.raw.row(i) += place.transpose();
  }
  dots.weights = Eigen::VectorXd::Ones(dots.raw.rows());
  Trend trend = trend_through(dots, field_order);
  const std::vector<int> degrees = polynomial_degrees();
  Eigen::VectorXd variances(Index(degrees.size()));
  for (Index k = 0; k < variances.size(); ++k)
    variances[k] = factor * variation.variance_px2[std::size_t(degrees[std::size_t(k)])];
  MatrixXd& covariance = trend.terms.covariance;
  covariance.setZero(trend.terms.coefficients.rows(), trend.terms.coefficients.rows());
  covariance.topLeftCorner(variances.size(), variances.size()) =
      field.from_monomials.transpose() * variances.asDiagonal() * field.from_monomials;
  trend.sigma_px = std::sqrt(factor * variation.rest_px2);
  DistortionMap map = like;
  map.model = std::make_shared<KrigingModel>(std::move(trend));
  return map;
}

DistortionMap without_covariance(const DistortionMap& map) {
  Json json = to_json(map);
  json["covariance"] = Json::array();
  return distortion_map_from_json(json, "map").value();
}

}  // namespace helicarm::rectification
