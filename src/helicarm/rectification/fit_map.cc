// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/fit_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "helicarm/rectification/basis.h"

namespace helicarm {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::MatrixX2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double centre_floor_px = 0.02;  // what a centre's own sigma does not know of
constexpr std::size_t max_knots = 150;

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

/// Points so thinned that at most `max_knots` are left, evenly spread.
MatrixX2d thinned(const std::vector<Vector2d>& points) {
  std::vector<Vector2d> kept = points;
  for (double gap = 0.05; kept.size() > max_knots; gap *= 1.15) {
    kept.clear();
    for (const Vector2d& p : points)
      if (std::all_of(kept.begin(), kept.end(), [&](const Vector2d& q) { return (p - q).norm() > gap; }))
        kept.push_back(p);
  }
  MatrixX2d knots(static_cast<Index>(kept.size()), 2);
  for (Index k = 0; k < knots.rows(); ++k) knots.row(k) = kept[static_cast<std::size_t>(k)].transpose();
  return knots;
}

/// Weighted (and, for kernels, penalised) linear least squares with its leave-one-out residuals.
struct Solution {
  MatrixX2d coefficients;
  MatrixX2d residuals;
  double held_out_rms = std::numeric_limits<double>::infinity();
  VectorXd held_out;    ///< distance per dot
  MatrixXd covariance;  ///< per axis, px^2
};

struct Design {
  MatrixXd rows;    ///< unweighted
  MatrixXd normal;  ///< weighted
  MatrixX2d right;
  MatrixXd penalty;  ///< of unit strength; zero for the polynomial
};

Design make_design(MatrixXd rows, const MatrixX2d& raw, const VectorXd& weights, const MatrixXd& gram) {
  Design design;
  design.rows = std::move(rows);
  const MatrixXd weighted = weights.asDiagonal() * design.rows;
  design.normal = design.rows.transpose() * weighted;
  design.right = weighted.transpose() * raw;
  design.penalty = MatrixXd::Zero(design.rows.cols(), design.rows.cols());
  if (gram.rows() > 0) design.penalty.bottomRightCorner(gram.rows(), gram.cols()) = gram;
  return design;
}

Solution solve(const Design& design, const MatrixX2d& raw, const VectorXd& weights, double strength) {
  const MatrixXd system = design.normal + strength * design.penalty;
  const Eigen::LDLT<MatrixXd> factor(system);
  Solution solution;
  if (factor.info() != Eigen::Success || !(factor.rcond() > 1e-15)) return solution;
  const MatrixXd inverse = factor.solve(MatrixXd::Identity(system.rows(), system.cols()));
  solution.coefficients = factor.solve(design.right);
  solution.residuals = raw - design.rows * solution.coefficients;
  const MatrixXd spread = design.rows * inverse;
  solution.held_out.resize(raw.rows());
  double sum = 0;
  double total = 0;
  double trace = 0;
  for (Index i = 0; i < raw.rows(); ++i) {
    const double leverage = weights[i] * spread.row(i).dot(design.rows.row(i));
    trace += leverage;
    if (leverage > 1 - 1e-6) return Solution{};
    solution.held_out[i] = solution.residuals.row(i).norm() / (1 - leverage);
    sum += weights[i] * solution.held_out[i] * solution.held_out[i];
    total += weights[i];
  }
  solution.held_out_rms = std::sqrt(sum / total);
  const double freedom = std::max(1.0, double(raw.rows()) - trace);
  const double variance =
      (weights.asDiagonal() * solution.residuals).cwiseProduct(solution.residuals).sum() / (2 * freedom);
  solution.covariance = variance * inverse;
  return solution;
}

struct Model {
  int order = 1;
  double length = 0;  ///< 0: no remainder
  double strength = 0;
  Solution solution;
};

struct Data {
  std::vector<Vector2d> points;  ///< normalised
  MatrixX2d raw;
  VectorXd weights;  ///< relative, mean one
};

MatrixXd rows_for(const Data& data, int order, const MatrixX2d& knots, double length) {
  MatrixXd rows(data.raw.rows(), term_count(order) + knots.rows());
  for (Index i = 0; i < rows.rows(); ++i)
    rows.row(i) = basis_row(data.points[static_cast<std::size_t>(i)], order, knots, length).transpose();
  return rows;
}

Model polynomial(const Data& data, int order) {
  Model model{order, 0, 0, {}};
  const Design design =
      make_design(rows_for(data, order, MatrixX2d(0, 2), 1), data.raw, data.weights, MatrixXd());
  model.solution = solve(design, data.raw, data.weights, 0);
  return model;
}

Model best_model(const Data& data, const MatrixX2d& knots, const MapOptions& options) {
  const Index n = data.raw.rows();
  if (options.order) return polynomial(data, *options.order);
  Model best;
  int best_order = 1;
  for (int order = 1; order <= options.max_order && 2 * term_count(order) <= n; ++order) {
    Model model = polynomial(data, order);
    // A higher order must earn its terms.
    if (model.solution.held_out_rms < 0.98 * best.solution.held_out_rms || order == 1) {
      best = std::move(model);
      best_order = order;
    }
  }
  if (!options.remainder || n < 20) return best;
  const int highest = n > 200 ? std::clamp(best_order, 3, 5) : 3;  // beyond the dots the trend alone speaks
  for (int order = 3; order <= highest; ++order) {
    if (2 * term_count(order) > n) break;
    for (const double length : {0.2, 0.3, 0.45, 0.7}) {
      const Index m = knots.rows();
      MatrixXd gram(m, m);
      for (Index i = 0; i < m; ++i)
        for (Index j = 0; j < m; ++j)
          gram(i, j) = kernel((knots.row(i) - knots.row(j)).squaredNorm(), length);
      gram.diagonal().array() += 1e-8;
      const Design design = make_design(rows_for(data, order, knots, length), data.raw, data.weights, gram);
      for (const double strength : {0.01, 0.03, 0.1, 0.3, 1.0}) {
        Solution solution = solve(design, data.raw, data.weights, strength);
        if (solution.held_out_rms < 0.98 * best.solution.held_out_rms)
          best = {order, length, strength, std::move(solution)};
      }
    }
  }
  return best;
}

double median(VectorXd values) {
  std::nth_element(values.data(), values.data() + values.size() / 2, values.data() + values.size());
  return values[values.size() / 2];
}

Data gather(const std::vector<Correspondence>& dots, const std::vector<Vector2d>& places, const Frame& frame,
            const std::vector<bool>& used) {
  Data data;
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
  data.weights /= data.weights.mean();
  return data;
}

/// Drops dots that the others contradict, the gravest first (of many dots, several at a time).
void reject_outliers(const std::vector<Correspondence>& dots, const std::vector<Vector2d>& places,
                     const Frame& frame, std::vector<bool>& used) {
  for (std::size_t round = 0; round < 10; ++round) {
    const Data data = gather(dots, places, frame, used);
    int order = 1;
    while (order < 4 && 3 * term_count(order + 1) <= data.raw.rows()) ++order;
    const Solution solution = polynomial(data, order).solution;
    if (solution.held_out.size() == 0) return;
    const double limit = std::max(0.4, 6 * median(solution.held_out));
    const double most = solution.held_out.maxCoeff();
    if (most <= limit) return;
    const double cut = dots.size() > 200 ? std::max(limit, 0.7 * most) : most;
    Index row = 0;
    for (std::size_t i = 0; i < used.size(); ++i)
      if (used[i] && solution.held_out[row++] >= cut) used[i] = false;
  }
}

DistortionMap map_of(const Model& model, const Frame& frame, const MatrixX2d& knots, int width, int height) {
  DistortionMap map;
  map.order = model.order;
  map.model = fmt::format("polynomial of order {}", model.order);
  map.centre = frame.centre;
  map.scale = frame.scale;
  const Index terms = term_count(model.order);
  map.coefficients = model.solution.coefficients.topRows(terms);
  map.knots.resize(0, 2);
  map.weights.resize(0, 2);
  if (model.length > 0) {
    map.model += ", smooth remainder";
    map.knots = knots;
    map.kernel_length = model.length;
    map.weights = model.solution.coefficients.bottomRows(knots.rows());
  }
  map.coefficient_covariance = model.solution.covariance;
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
    return fail(Reason::plate_not_found, fmt::format("{} plate dots carry no rectification", dots.size()),
                {{"dots_found", double(dots.size())}});
  };
  const int least_order = options.order.value_or(1);
  if (static_cast<Index>(dots.size()) < std::max<Index>(6, term_count(least_order) + 2)) return too_few();

  // First on the plate, to learn the scale and turn at the middle of the picture.
  std::vector<Vector2d> places = places_of(dots);
  Frame frame = frame_of(places);
  if (!(frame.scale > 0)) return too_few();
  if (options.reject_outliers) reject_outliers(dots, places, frame, fit.used);
  Data data = gather(dots, places, frame, fit.used);
  if (data.raw.rows() < term_count(least_order) + 2) return too_few();
  int order = 1;
  while (order < 3 && 2 * term_count(order + 1) <= data.raw.rows()) ++order;
  const Model rough = polynomial(data, order);
  if (rough.solution.coefficients.size() == 0) return too_few();
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

  // Then in rectified pixels: raw scale and no turn at the middle.
  fit.rectified_from_plate.linear() = px_per_mm * turn;
  fit.rectified_from_plate.translation() = middle - px_per_mm * (turn * middle_mm);
  for (Vector2d& place : places) place = fit.rectified_from_plate * place;
  frame = frame_of(places);
  data = gather(dots, places, frame, fit.used);
  const MatrixX2d knots = thinned(data.points);
  const Model model = best_model(data, knots, options);
  if (model.solution.coefficients.size() == 0) return too_few();
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
  fit.map.held_out_rms_px =
      std::sqrt(model.solution.held_out.squaredNorm() / double(model.solution.held_out.size()));
  return fit;
}

}  // namespace helicarm
