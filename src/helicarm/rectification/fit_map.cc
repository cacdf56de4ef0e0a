// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/fit_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "helicarm/rectification/basis.h"
#include "helicarm/rectification/kriging.h"

namespace helicarm::rectification {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::MatrixX2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double centre_floor_px = 0.02;  // centre error that the centre's own sigma does not include
constexpr std::size_t max_knots = 240;

struct Frame {
  Vector2d centre;
  double scale;
  Vector2d normalised(const Vector2d& p) const { return (p - centre) / scale; }
};

Frame frame_of(const std::vector<Vector2d>& places) {
  Vector2d low = places.front();
  Vector2d high = places.front();
  for (const Vector2d& p : places) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return {0.5 * (low + high), 0.5 * (high - low).maxCoeff()};
}

/// A thinned, evenly spread subset of at most `max_knots` points.
MatrixX2d thinned(const std::vector<Vector2d>& points) {
  std::vector<Vector2d> kept = points;
  for (double gap = 0.05; kept.size() > max_knots; gap *= 1.05) {
    kept.clear();
    for (const Vector2d& p : points)
      if (std::all_of(kept.begin(), kept.end(), [&](const Vector2d& q) { return (p - q).norm() > gap; }))
        kept.push_back(p);
  }
  MatrixX2d knots(static_cast<Index>(kept.size()), 2);
  for (Index k = 0; k < knots.rows(); ++k) knots.row(k) = kept[static_cast<std::size_t>(k)].transpose();
  return knots;
}

/// Of models in the order of decreasing simplicity, the last whose held-out error is clearly smaller.
template <class ModelOf>
KrigingModel simplest_good(int low, int high, const ModelOf& model_of) {
  KrigingModel best = model_of(low);
  for (int order = low + 1; order <= high; ++order) {
    KrigingModel model = model_of(order);
    if (model.fit.held_out_rms < 0.98 * best.fit.held_out_rms) best = std::move(model);
  }
  return best;
}

KrigingModel best_model(const KrigingData& data, const MatrixX2d& knots, const MapOptions& options) {
  constexpr int cubic = 3;  // beyond the dots only the trend remains: it must extrapolate moderately
  const Index n = data.raw.rows();
  if (options.order) return polynomial_model(data, *options.order);
  int highest = 1;
  while (highest < options.max_order && 2 * term_count(highest + 1) <= n) ++highest;
  if (options.remainder && highest >= cubic)
    return simplest_good(cubic, n > 200 ? std::min(highest, 5) : cubic,
                         [&](int order) { return smooth_model(data, order, knots); });
  return simplest_good(1, highest, [&](int order) { return polynomial_model(data, order); });
}

double median(VectorXd values) {
  std::nth_element(values.data(), values.data() + values.size() / 2, values.data() + values.size());
  return values[values.size() / 2];
}

KrigingData gather(const std::vector<Correspondence>& dots, const std::vector<Vector2d>& places,
                   const Frame& frame, const std::vector<bool>& used) {
  KrigingData data;
  std::vector<std::size_t> rows;
  for (std::size_t i = 0; i < dots.size(); ++i)
    if (used[i]) rows.push_back(i);
  data.raw.resize(static_cast<Index>(rows.size()), 2);
  data.weights.resize(static_cast<Index>(rows.size()));
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const Correspondence& dot = dots[rows[k]];
    data.points.push_back(frame.normalised(places[rows[k]]));
    data.raw.row(static_cast<Index>(k)) = dot.raw_px.transpose();
    data.weights[static_cast<Index>(k)] =
        1 / (dot.sigma_px * dot.sigma_px + centre_floor_px * centre_floor_px);
  }
  data.variance = 1 / data.weights.mean();
  data.weights *= data.variance;
  return data;
}

/// For each dot its nearest neighbours, nearest first.
std::vector<std::vector<std::size_t>> neighbours_of(const std::vector<Vector2d>& places) {
  const std::size_t count = std::min<std::size_t>(8, places.size() - 1);
  std::vector<std::vector<std::size_t>> neighbours(places.size());
  std::vector<std::pair<double, std::size_t>> by_distance(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    for (std::size_t j = 0; j < places.size(); ++j)
      by_distance[j] = {(places[j] - places[i]).squaredNorm(), j};
    by_distance[i].first = std::numeric_limits<double>::infinity();
    std::partial_sort(by_distance.begin(), by_distance.begin() + static_cast<std::ptrdiff_t>(count),
                      by_distance.end());
    for (std::size_t k = 0; k < count; ++k) neighbours[i].push_back(by_distance[k].second);
  }
  return neighbours;
}

/// Rejects dots inconsistent with their neighbours, largest residual first (of many dots, several at a time).
/// A deviation shared by neighbours is local distortion of the screen, not an outlier.
void reject_outliers(const std::vector<Correspondence>& dots, const std::vector<Vector2d>& places,
                     const Frame& frame, std::vector<bool>& used) {
  const auto neighbours = neighbours_of(places);
  for (std::size_t round = 0; round < 10; ++round) {
    const KrigingData data = gather(dots, places, frame, used);
    int order = 1;
    while (order < 4 && 3 * term_count(order + 1) <= data.raw.rows()) ++order;
    const LinearFit solution = polynomial_model(data, order).fit;
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
        if (beside.size() > 2)
          shared[axis] = median(Eigen::Map<VectorXd>(beside.data(), Index(beside.size())));
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

DistortionMap map_of(const KrigingModel& model, const Frame& frame, const MatrixX2d& knots, int width,
                     int height) {
  DistortionMap map;
  map.order = model.order;
  map.model = fmt::format("polynomial of order {}", model.order);
  map.centre = frame.centre;
  map.scale = frame.scale;
  const Index terms = term_count(model.order);
  map.coefficients = model.fit.coefficients.topRows(terms);
  map.knots.resize(0, 2);
  map.weights.resize(0, 2);
  if (model.length > 0) {
    map.model += ", smooth remainder";
    map.knots = knots;
    map.kernel_length = model.length;
    map.kernel_sigma_px = model.sigma;
    map.weights = model.fit.coefficients.bottomRows(knots.rows());
  }
  map.coefficient_covariance = model.fit.covariance;
  map.width = width;
  map.height = height;
  return map;
}

std::vector<Vector2d> places_of(const std::vector<Correspondence>& dots) {
  std::vector<Vector2d> places;
  for (const Correspondence& dot : dots) places.push_back(dot.place_mm);
  return places;
}

}  // namespace

Expected<MapFit> fit_map(const std::vector<Correspondence>& dots, int width, int height,
                         const MapOptions& options) {
  MapFit fit;
  fit.used.assign(dots.size(), true);
  const auto too_few = [&] {
    return fail(Reason::plate_not_found,
                fmt::format("{} plate dots do not determine a rectification", dots.size()),
                {{"dots_found", double(dots.size())}});
  };
  const int least_order = options.order.value_or(1);
  if (static_cast<Index>(dots.size()) < std::max<Index>(6, term_count(least_order) + 2)) return too_few();

  // First in plate coordinates, to obtain scale and rotation at the image centre.
  std::vector<Vector2d> places = places_of(dots);
  Frame frame = frame_of(places);
  if (!(frame.scale > 0)) return too_few();
  if (options.reject_outliers) reject_outliers(dots, places, frame, fit.used);
  KrigingData data = gather(dots, places, frame, fit.used);
  if (data.raw.rows() < term_count(least_order) + 2) return too_few();
  int order = 1;
  while (order < 3 && 2 * term_count(order + 1) <= data.raw.rows()) ++order;
  const KrigingModel rough = polynomial_model(data, order);
  if (rough.fit.coefficients.size() == 0) return too_few();
  const DistortionMap on_plate = map_of(rough, frame, MatrixX2d(0, 2), width, height);
  const Vector2d middle(0.5 * (width - 1), 0.5 * (height - 1));
  Vector2d middle_mm = frame.centre;
  for (int i = 0; i < 20; ++i)
    middle_mm += (on_plate.jacobian(middle_mm).inverse() * (middle - on_plate.raw_from_rectified(middle_mm)))
                     .cwiseMax(-0.5 * frame.scale)
                     .cwiseMin(0.5 * frame.scale);
  const Matrix2d slope = on_plate.jacobian(middle_mm);
  const double px_per_mm = std::sqrt(std::abs(slope.determinant()));
  const Eigen::JacobiSVD<Matrix2d> svd(slope, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Matrix2d turn = svd.matrixU() * svd.matrixV().transpose();
  if (!middle_mm.allFinite() || !(px_per_mm > 0)) return too_few();

  // Then in rectified pixels: raw scale and no rotation at the image centre.
  fit.rectified_from_plate.linear() = px_per_mm * turn;
  fit.rectified_from_plate.translation() = middle - px_per_mm * (turn * middle_mm);
  for (Vector2d& place : places) place = fit.rectified_from_plate * place;
  frame = frame_of(places);
  data = gather(dots, places, frame, fit.used);
  const MatrixX2d knots = thinned(data.points);
  const KrigingModel model = best_model(data, knots, options);
  if (model.fit.coefficients.size() == 0) return too_few();
  fit.map = map_of(model, frame, knots, width, height);
  fit.px_per_mm = px_per_mm;
  double sum = 0;
  int count = 0;
  fit.map.hull_low = frame.centre;
  fit.map.hull_high = frame.centre;
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
  fit.map.held_out_rms_px = std::sqrt(model.fit.held_out.squaredNorm() / double(model.fit.held_out.size()));
  return fit;
}

}  // namespace helicarm::rectification