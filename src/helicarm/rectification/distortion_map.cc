// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/distortion_map.h"

#include <cmath>

#include <Eigen/Dense>

#include "helicarm/rectification/basis.h"

namespace helicarm::rectification {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr Range any{-1e9, 1e9};

Json rows_of(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    Json row = Json::array();
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) row.push_back(matrix(r, c));
    rows.push_back(std::move(row));
  }
  return rows;
}

Eigen::MatrixXd matrix_of(JsonReader& reader, const char* key, Eigen::Index columns, std::size_t max_rows) {
  const Json& value = reader.raw(key);
  const std::size_t rows = value.is_array() ? value.size() : 0;
  if (!value.is_array() || rows > max_rows)
    reader.refuse(Reason::bad_value, key, "is not a list of allowed length");
  const auto numbers = reader.matrix(key, rows, static_cast<std::size_t>(columns), {-1e12, 1e12});
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      numbers.data(), static_cast<Eigen::Index>(rows), columns);
}

Vector2d pair_of(JsonReader& reader, const char* key) {
  const auto numbers = reader.numbers(key, 2, any);
  return {numbers[0], numbers[1]};
}

}  // namespace

bool DistortionMap::shows(const Vector2d& raw) const {
  return (raw.array() >= -0.5).all() && raw.x() <= width - 0.5 && raw.y() <= height - 0.5;
}

Vector2d DistortionMap::raw_from_rectified(const Vector2d& rectified) const {
  if (is_identity()) return rectified;
  const Vector2d t = (rectified - centre) / scale;
  Vector2d raw = coefficients.transpose() * monomials(t, order);
  for (Eigen::Index k = 0; k < knots.rows(); ++k)
    raw += kernel((t - knots.row(k).transpose()).squaredNorm(), kernel_length) * weights.row(k).transpose();
  return raw;
}

Matrix2d DistortionMap::jacobian(const Vector2d& rectified) const {
  if (is_identity()) return Matrix2d::Identity();
  const Vector2d t = (rectified - centre) / scale;
  Matrix2d slope = coefficients.transpose() * monomial_slopes(t, order);
  for (Eigen::Index k = 0; k < knots.rows(); ++k) {
    const Vector2d d = t - knots.row(k).transpose();
    slope += kernel_slope(d.squaredNorm(), kernel_length) * weights.row(k).transpose() * d.transpose();
  }
  return slope / scale;
}

std::optional<Vector2d> DistortionMap::rectified_from_raw(const Vector2d& raw) const {
  if (is_identity()) return raw;
  Vector2d rectified = raw;
  for (int i = 0; i < 30; ++i) {
    const Matrix2d slope = jacobian(rectified);
    if (!(slope.determinant() > 0.05)) return std::nullopt;
    const Vector2d step = slope.inverse() * (raw - raw_from_rectified(rectified));
    rectified += step;
    if (!rectified.allFinite() || (rectified - raw).norm() > scale) return std::nullopt;
    if (step.norm() < 1e-11 * scale) return rectified;
  }
  return std::nullopt;
}

double DistortionMap::sigma_px(const Vector2d& rectified) const {
  if (is_identity() || coefficient_covariance.size() == 0) return 0;
  const Vector2d t = (rectified - centre) / scale;
  const Eigen::VectorXd row = basis_row(t, order, knots, kernel_length);
  return std::sqrt(std::max(0.0, kernel_sigma_px * kernel_sigma_px + row.dot(coefficient_covariance * row)));
}

Eigen::MatrixXd DistortionMap::covariance_px2(std::span<const Vector2d> rectified) const {
  const auto n = static_cast<Eigen::Index>(rectified.size());
  if (is_identity() || coefficient_covariance.size() == 0) return Eigen::MatrixXd::Zero(n, n);
  Eigen::MatrixXd rows(n, coefficient_covariance.rows());
  for (Eigen::Index i = 0; i < n; ++i)
    rows.row(i) =
        basis_row((rectified[static_cast<std::size_t>(i)] - centre) / scale, order, knots, kernel_length);
  Eigen::MatrixXd covariance = rows * coefficient_covariance * rows.transpose();
  if (kernel_sigma_px > 0)
    for (Eigen::Index j = 0; j < n; ++j)
      for (Eigen::Index i = 0; i < n; ++i)
        covariance(i, j) +=
            kernel_sigma_px * kernel_sigma_px *
            kernel((rectified[static_cast<std::size_t>(i)] - rectified[static_cast<std::size_t>(j)])
                           .squaredNorm() /
                       (scale * scale),
                   kernel_length);
  return covariance;
}

std::optional<Vector2d> rectified_in_image(const DistortionMap& map, const Vector2d& raw) {
  return map.shows(raw) ? map.rectified_from_raw(raw) : std::nullopt;
}

std::optional<Vector2d> raw_in_image(const DistortionMap& map, const Vector2d& rectified) {
  const Vector2d raw = map.raw_from_rectified(rectified);
  const auto back = rectified_in_image(map, raw);
  return back && (*back - rectified).norm() < 1e-6 ? std::optional(raw) : std::nullopt;
}

DistortionMap identity_map(int width, int height, std::optional<double> pixel_mm) {
  DistortionMap map;
  map.width = width;
  map.height = height;
  map.hull_high = {width - 1.0, height - 1.0};
  map.rectified_pixel_mm = pixel_mm;
  if (pixel_mm) map.rectified_plane = RectifiedPlane::detector;
  return map;
}

Json to_json(const DistortionMap& map) {
  Json json;
  json["format"] = "helicarm-map/1";
  json["model"] = map.model;
  json["image_size"] = {map.width, map.height};
  json["order"] = map.order;
  json["centre"] = {map.centre.x(), map.centre.y()};
  json["scale"] = map.scale;
  json["coefficients"] = rows_of(map.coefficients);
  json["kernel"] = "matern-3/2";
  json["kernel_length"] = map.kernel_length;
  json["kernel_sigma_px"] = map.kernel_sigma_px;
  json["knots"] = rows_of(map.knots);
  json["weights"] = rows_of(map.weights);
  json["covariance"] = rows_of(map.coefficient_covariance);
  json["hull"] = {{map.hull_low.x(), map.hull_low.y()}, {map.hull_high.x(), map.hull_high.y()}};
  json["residual_rms_px"] = map.residual_rms_px;
  json["residual_max_px"] = map.residual_max_px;
  json["held_out_rms_px"] = map.held_out_rms_px;
  json["rectified_pixel_mm"] = map.rectified_pixel_mm ? Json(*map.rectified_pixel_mm) : Json();
  json["rectified_plane"] =
      map.rectified_plane ? Json(*map.rectified_plane == RectifiedPlane::detector ? "detector" : "plate")
                          : Json();
  return json;
}

Expected<DistortionMap> distortion_map_from_json(const Json& json, const std::string& origin) {
  return guarded([&] {
    JsonReader reader(json, origin);
    reader.choice("format", {"helicarm-map/1"});
    DistortionMap map;
    map.model = reader.text("model");
    const auto size = reader.numbers("image_size", 2, {1, 65535});
    map.width = static_cast<int>(size[0]);
    map.height = static_cast<int>(size[1]);
    map.order = reader.integer("order", 0, 9);
    map.centre = pair_of(reader, "centre");
    map.scale = reader.number("scale", {1e-6, 1e6});
    map.coefficients = matrix_of(reader, "coefficients", 2, 200);
    reader.choice("kernel", {"matern-3/2"});
    map.kernel_length = reader.number("kernel_length", {0, 1e3});
    map.kernel_sigma_px = reader.number("kernel_sigma_px", {0, 1e4});
    map.knots = matrix_of(reader, "knots", 2, 2000);
    map.weights = matrix_of(reader, "weights", 2, 2000);
    const auto terms = map.coefficients.rows() + map.knots.rows();
    if (reader.has("covariance") && !json["covariance"].empty()) {
      map.coefficient_covariance = matrix_of(reader, "covariance", terms, 2200);
      if (map.coefficient_covariance.rows() != terms)
        reader.refuse(Reason::bad_value, "covariance", "is not square");
    } else {
      reader.raw("covariance");
    }
    const auto hull = reader.matrix("hull", 2, 2, any);
    map.hull_low = {hull[0], hull[1]};
    map.hull_high = {hull[2], hull[3]};
    map.residual_rms_px = reader.number("residual_rms_px", {0, 1e6});
    map.residual_max_px = reader.number("residual_max_px", {0, 1e6});
    map.held_out_rms_px = reader.number("held_out_rms_px", {0, 1e6});
    map.rectified_pixel_mm = reader.optional_number("rectified_pixel_mm", {1e-4, 100});
    if (reader.has("rectified_plane"))
      map.rectified_plane = reader.choice("rectified_plane", {"detector", "plate"}) == 0
                                ? RectifiedPlane::detector
                                : RectifiedPlane::plate;
    else
      reader.raw("rectified_plane");
    reader.finish();
    if (map.order > 0 && map.coefficients.rows() != term_count(map.order))
      reader.refuse(Reason::bad_value, "coefficients", "do not match the order");
    if (map.weights.rows() != map.knots.rows())
      reader.refuse(Reason::bad_value, "weights", "do not match the knots");
    if (map.knots.rows() > 0 && !(map.kernel_length > 0))
      reader.refuse(Reason::bad_value, "kernel_length", "must be positive where there are knots");
    return map;
  });
}

}  // namespace helicarm::rectification
