// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/fit_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "helicarm/core/statistics.h"
#include "helicarm/geometry/near_points.h"
#include "helicarm/rectification/models/monomials.h"
#include "helicarm/rectification/models/polynomial.h"
#include "helicarm/rectification/pixel_map.h"

namespace helicarm::rectification {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::MatrixX2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double centre_floor_px = 0.02;  // centre error that the centre's own sigma does not include

Normalisation normalisation_of(const std::vector<Vector2d>& places) {
  Vector2d low = places.front();
  Vector2d high = places.front();
  for (const Vector2d& p : places) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return {0.5 * (low + high), 0.5 * (high - low).maxCoeff()};
}

PlateDots gather(const std::vector<Correspondence>& dots, const std::vector<Vector2d>& places,
                 const Normalisation& normalised, const std::vector<bool>& used) {
  PlateDots data;
  data.normalised = normalised;
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < dots.size(); ++i)
    if (used[i]) rows.push_back(i);
  data.raw.resize(static_cast<Index>(rows.size()), 2);
  data.weights.resize(static_cast<Index>(rows.size()));
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const Correspondence& dot = dots[rows[k]];
    data.points.push_back(normalised(places[rows[k]]));
    data.raw.row(static_cast<Index>(k)) = dot.raw_px.transpose();
    data.weights[static_cast<Index>(k)] =
        1 / (dot.sigma_px * dot.sigma_px + centre_floor_px * centre_floor_px);
  }
  data.variance = 1 / data.weights.mean();
  data.weights *= data.variance;
  return data;
}

/// For each dot its nearest neighbours, nearest first.
std::vector<std::vector<std::size_t>> neighbours_of(const std::vector<Vector2d>& places,
                                                    const Normalisation& normalised) {
  constexpr std::size_t count = 8;
  const geometry::NearPoints near(places, 2 * normalised.scale / std::sqrt(double(places.size())));
  std::vector<std::vector<std::size_t>> neighbours;
  for (std::size_t i = 0; i < places.size(); ++i) neighbours.push_back(near.nearest_to(i, count));
  return neighbours;
}

/// Rejects dots inconsistent with their neighbours, largest residual first (of many dots, several at a time).
/// A deviation shared by neighbours is local distortion of the screen, not an outlier.
void reject_outliers(const std::vector<Correspondence>& dots, const std::vector<Vector2d>& places,
                     const Normalisation& normalised, std::vector<bool>& used) {
  const auto neighbours = neighbours_of(places, normalised);
  for (std::size_t round = 0; round < 10; ++round) {
    const PlateDots data = gather(dots, places, normalised, used);
    int order = 1;
    while (order < 4 && 3 * term_count(order + 1) <= data.raw.rows()) ++order;
    const LinearFit solution = fit_polynomial(data, order);
    if (solution.studentized.rows() == 0) return;
    std::vector<Vector2d> residuals(dots.size());
    for (std::size_t i = 0, row = 0; i < dots.size(); ++i)
      if (used[i]) residuals[i] = solution.studentized.row(static_cast<Index>(row++)).transpose();
    VectorXd contradiction = VectorXd::Zero(data.raw.rows());
    for (std::size_t i = 0, row = 0; i < dots.size(); ++i) {
      if (!used[i]) continue;
      Vector2d shared = Vector2d::Zero();
      for (const int axis : {0, 1}) {
        std::vector<double> beside;
        for (const std::size_t j : neighbours[i])
          if (used[j]) beside.push_back(residuals[j][axis]);
        if (beside.size() > 2) shared[axis] = median(beside);
      }
      contradiction[static_cast<Index>(row++)] =
          std::min((residuals[i] - shared).norm(), residuals[i].norm());
    }
    const double limit = std::max(0.4, 6 * median(contradiction));
    const double most = contradiction.maxCoeff();
    if (most <= limit) return;
    const double cut = dots.size() > 200 ? std::max(limit, 0.7 * most) : most;
    for (std::size_t i = 0, row = 0; i < dots.size(); ++i)
      if (used[i] && contradiction[static_cast<Index>(row++)] >= cut) used[i] = false;
  }
}

std::vector<Vector2d> places_of(const std::vector<Correspondence>& dots) {
  std::vector<Vector2d> places;
  for (const Correspondence& dot : dots) places.push_back(dot.place_mm);
  return places;
}

/// Similarity after which the map has scale 1 and no rotation at the image centre; nothing if the dots do not
/// determine it.
std::optional<Eigen::Affine2d> rectified_from_plate(const PlateDots& dots, const Vector2d& middle) {
  const int order = std::min(3, highest_order(dots.raw.rows()));
  const ModelPointer on_plate = model_kind("polynomial")->fit(dots, order).model;
  if (!on_plate) return {};
  const double reach = 0.5 * dots.normalised.scale;
  Vector2d middle_mm = dots.normalised.centre;
  for (int i = 0; i < 20; ++i)
    middle_mm +=
        (on_plate->jacobian(middle_mm).inverse() * (middle - on_plate->raw_from_rectified(middle_mm)))
            .cwiseMax(-reach)
            .cwiseMin(reach);
  const Matrix2d slope = on_plate->jacobian(middle_mm);
  const double px_per_mm = std::sqrt(std::abs(slope.determinant()));
  const Eigen::JacobiSVD<Matrix2d> svd(slope, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Matrix2d turn = svd.matrixU() * svd.matrixV().transpose();
  if (!middle_mm.allFinite() || !(px_per_mm > 0)) return {};
  Eigen::Affine2d similarity = Eigen::Affine2d::Identity();
  similarity.linear() = px_per_mm * turn;
  similarity.translation() = middle - px_per_mm * (turn * middle_mm);
  return similarity;
}

/// `is_in_pixels`: places are rectified already.
Expected<MapFit> fitted_map(const std::vector<Correspondence>& dots, int width, int height,
                            const MapOptions& options, bool is_in_pixels) {
  MapFit fit;
  fit.used.assign(dots.size(), true);
  const ModelKind* kind = model_kind(options.model.empty() ? "polynomial" : options.model);
  if (!kind)
    return fail(Reason::bad_value,
                fmt::format("distortion model \"{}\" is none of {}", options.model, model_names()));
  if (options.model.empty() && !options.order) kind = nullptr;
  const auto too_few = [&] {
    return fail(Reason::plate_not_found,
                fmt::format("{} plate dots do not determine a rectification", dots.size()),
                {{"dots_found", double(dots.size())}});
  };
  const int least_order = options.order.value_or(1);
  if (static_cast<Index>(dots.size()) < std::max<Index>(6, term_count(least_order) + 2)) return too_few();

  // First in plate coordinates, to obtain scale and rotation at the image centre.
  std::vector<Vector2d> places = places_of(dots);
  Normalisation normalised = normalisation_of(places);
  if (!(normalised.scale > 0)) return too_few();
  if (options.reject_outliers) reject_outliers(dots, places, normalised, fit.used);
  PlateDots data = gather(dots, places, normalised, fit.used);
  if (data.raw.rows() < term_count(least_order) + 2) return too_few();
  const Vector2d middle(0.5 * (width - 1), 0.5 * (height - 1));
  const auto similarity =
      is_in_pixels ? std::optional(Eigen::Affine2d::Identity()) : rectified_from_plate(data, middle);
  if (!similarity) return too_few();

  // Then in rectified pixels: raw scale and no rotation at the image centre.
  fit.rectified_from_plate = *similarity;
  for (Vector2d& position : places) position = fit.rectified_from_plate * position;
  normalised = normalisation_of(places);
  data = gather(dots, places, normalised, fit.used);
  data.image_centre = normalised(middle);
  const ModelFit fitted = kind ? kind->fit(data, options.order) : automatic_fit(data);
  if (!fitted.model) return too_few();
  fit.map.model = fitted.model;
  fit.map.width = width;
  fit.map.height = height;
  fit.px_per_mm = std::sqrt(std::abs(fit.rectified_from_plate.linear().determinant()));
  double sum = 0;
  int count = 0;
  fit.map.hull_low = normalised.centre;
  fit.map.hull_high = normalised.centre;
  for (std::size_t i = 0; i < dots.size(); ++i) {
    const double residual = (dots[i].raw_px - fit.map.raw_from_rectified(places[i])).norm();
    fit.residual_px.push_back(residual);
    if (!fit.used[i]) continue;
    sum += residual * residual;
    ++count;
    fit.map.residual_max_px = std::max(fit.map.residual_max_px, residual);
    fit.map.hull_low = fit.map.hull_low.cwiseMin(places[i]);
    fit.map.hull_high = fit.map.hull_high.cwiseMax(places[i]);
  }
  fit.map.residual_rms_px = std::sqrt(sum / count);
  fit.map.held_out_rms_px = std::sqrt(fitted.held_out.squaredNorm() / double(fitted.held_out.size()));
  return fit;
}

}  // namespace

Expected<MapFit> fit_map(const std::vector<Correspondence>& dots, int width, int height,
                         const MapOptions& options) {
  return fitted_map(dots, width, height, options, false);
}

Expected<MapFit> fit_pixel_map(const std::vector<Correspondence>& dots, int width, int height,
                               const MapOptions& options) {
  return fitted_map(dots, width, height, options, true);
}

}  // namespace helicarm::rectification
