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

/// Points so thinned that at most `max_knots` are left, evenly spread.
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

/// Weighted (and, for kernels, penalised) linear least squares with its leave-one-out residuals.
struct Solution {
  MatrixX2d coefficients;
  MatrixX2d residuals;
  double held_out_rms = std::numeric_limits<double>::infinity();
  VectorXd held_out;      ///< distance per dot
  MatrixX2d studentized;  ///< residual over the share of it that the dot itself has not drawn in, px
  double variance = 0;    ///< of a dot of weight one, as the residuals have it, px^2
  MatrixXd covariance;    ///< of the coefficients, per axis, over that variance
};

struct Data {
  std::vector<Vector2d> points;  ///< normalised
  MatrixX2d raw;
  VectorXd weights;     ///< relative, mean one
  double variance = 0;  ///< of a dot of weight one, as its own sigma has it, px^2
};

/// `penalty` (none: 0 x 0) is that of the last coefficients.
Solution solve(const Data& data, const MatrixXd& rows, const MatrixXd& penalty) {
  const MatrixX2d& raw = data.raw;
  const VectorXd& weights = data.weights;
  const MatrixXd weighted = weights.asDiagonal() * rows;
  MatrixXd system = rows.transpose() * weighted;
  system.bottomRightCorner(penalty.rows(), penalty.cols()) += penalty;
  const Eigen::LDLT<MatrixXd> factor(system);
  Solution solution;
  if (factor.info() != Eigen::Success || !(factor.rcond() > 1e-15)) return solution;
  const MatrixXd inverse = factor.solve(MatrixXd::Identity(system.rows(), system.cols()));
  solution.coefficients = factor.solve(weighted.transpose() * raw);
  solution.residuals = raw - rows * solution.coefficients;
  const MatrixXd spread = rows * inverse;
  solution.held_out.resize(raw.rows());
  solution.studentized.resize(raw.rows(), 2);
  double sum = 0;
  double total = 0;
  double trace = 0;
  for (Index i = 0; i < raw.rows(); ++i) {
    const double leverage = weights[i] * spread.row(i).dot(rows.row(i));
    trace += leverage;
    if (leverage > 1 - 1e-6) return Solution{};
    solution.held_out[i] = solution.residuals.row(i).norm() / (1 - leverage);
    solution.studentized.row(i) = solution.residuals.row(i) / std::sqrt(1 - leverage);
    sum += weights[i] * solution.held_out[i] * solution.held_out[i];
    total += weights[i];
  }
  solution.held_out_rms = std::sqrt(sum / total);
  const double freedom = std::max(1.0, double(raw.rows()) - trace);
  solution.variance =
      (weights.asDiagonal() * solution.residuals).cwiseProduct(solution.residuals).sum() / (2 * freedom);
  solution.covariance = inverse;
  return solution;
}

struct Model {
  int order = 1;
  double length = 0;  ///< 0: no remainder
  double sigma = 0;   ///< of the remainder before any dot is seen, px
  Solution solution;
};

MatrixXd rows_for(const Data& data, int order, const MatrixX2d& knots, double length) {
  MatrixXd rows(data.raw.rows(), term_count(order) + knots.rows());
  for (Index i = 0; i < rows.rows(); ++i)
    rows.row(i) = basis_row(data.points[static_cast<std::size_t>(i)], order, knots, length).transpose();
  return rows;
}

MatrixXd gram_of(const MatrixX2d& knots, double length) {
  MatrixXd gram(knots.rows(), knots.rows());
  for (Index j = 0; j < knots.rows(); ++j)
    for (Index i = 0; i < knots.rows(); ++i)
      gram(i, j) = kernel((knots.row(i) - knots.row(j)).squaredNorm(), length);
  gram.diagonal().array() += 1e-7;
  return gram;
}

Model polynomial(const Data& data, int order) {
  Model model{order, 0, 0, solve(data, rows_for(data, order, MatrixX2d(0, 2), 1), MatrixXd())};
  model.solution.covariance *= model.solution.variance;
  return model;
}

/// How rough the remainder is and how noisy the dots are, as likely as they come.
struct Roughness {
  double length = 0;
  double gain = 0;      ///< remainder's variance over that of a dot of weight one
  double variance = 0;  ///< of a dot of weight one, px^2
  double misfit = std::numeric_limits<double>::infinity();  ///< -2 log of the restricted likelihood
};

/// The restricted likelihood (Patterson and Thompson 1971) of a remainder of one length, the trend projected
/// out, over gains; the dots' own sigmas are believed to within a factor of 1.5.
Roughness roughness_of(const Data& data, const MatrixXd& rows, const MatrixXd& gram, double length) {
  constexpr double log_variance_sigma = 0.8;
  const Index knots = gram.rows();
  const VectorXd root = data.weights.cwiseSqrt();
  const MatrixXd weighted = root.asDiagonal() * rows;
  const Index terms = rows.cols() - knots;
  const MatrixXd trend = Eigen::HouseholderQR<MatrixXd>(weighted.leftCols(terms)).householderQ() *
                         MatrixXd::Identity(rows.rows(), terms);
  MatrixXd kernels = gram.llt().matrixL().solve(weighted.rightCols(knots).transpose()).transpose();
  kernels -= trend * (trend.transpose() * kernels);
  MatrixX2d raw = root.asDiagonal() * data.raw;
  raw -= trend * (trend.transpose() * raw);
  const Eigen::SelfAdjointEigenSolver<MatrixXd> modes(kernels.transpose() * kernels);
  const MatrixX2d along = modes.eigenvectors().transpose() * (kernels.transpose() * raw);
  const double freedom = 2.0 * double(rows.rows() - terms);
  Roughness best;
  for (double gain = 1e-2; gain < 1e6; gain *= 1.5) {
    // y' (I + gain K K')^-1 y and log det (I + gain K K') of both axes, by the modes of K'K.
    double energy = raw.squaredNorm();
    double log_determinant = 0;
    for (Index k = 0; k < knots; ++k) {
      const double raised = 1 + gain * std::max(0.0, modes.eigenvalues()[k]);
      energy -= gain / raised * along.row(k).squaredNorm();
      log_determinant += 2 * std::log(raised);
    }
    energy = std::max(energy, 1e-12 * data.variance);
    const auto misfit = [&](double log_variance) {
      const double surprise = (log_variance - std::log(data.variance)) / log_variance_sigma;
      return freedom * log_variance + energy * std::exp(-log_variance) + log_determinant +
             surprise * surprise;
    };
    double x = std::log(energy / freedom);
    for (int i = 0; i < 20; ++i) {
      const double belief = 2 / (log_variance_sigma * log_variance_sigma);
      const double pull = energy * std::exp(-x);
      x -= std::clamp((freedom - pull + belief * (x - std::log(data.variance))) / (pull + belief), -1.0, 1.0);
    }
    if (misfit(x) < best.misfit) best = {length, gain, std::exp(x), misfit(x)};
  }
  return best;
}

/// Universal kriging: a polynomial trend and a Matern remainder.
Model smooth_model(const Data& data, int order, const MatrixX2d& knots) {
  Roughness best;
  for (const double length : {0.14, 0.2, 0.28, 0.4, 0.57, 0.8, 1.1, 1.6, 2.2}) {
    const Roughness roughness =
        roughness_of(data, rows_for(data, order, knots, length), gram_of(knots, length), length);
    if (roughness.misfit < best.misfit) best = roughness;
  }
  if (!(best.length > 0)) return {};
  const MatrixXd gram = gram_of(knots, best.length);
  Model model{order, best.length, std::sqrt(best.gain * best.variance),
              solve(data, rows_for(data, order, knots, best.length), gram / best.gain)};
  // What the dots leave of the remainder's own variance: see DistortionMap::coefficient_covariance.
  MatrixXd& covariance = model.solution.covariance;
  covariance *= best.variance;
  covariance.bottomRightCorner(gram.rows(), gram.cols()) -=
      best.gain * best.variance * gram.llt().solve(MatrixXd::Identity(gram.rows(), gram.cols()));
  return model;
}

/// Of the models of falling simplicity the last that earns its terms: whose held-out error is clearly less.
template <class ModelOf>
Model simplest_good(int low, int high, const ModelOf& model_of) {
  Model best = model_of(low);
  for (int order = low + 1; order <= high; ++order) {
    Model model = model_of(order);
    if (model.solution.held_out_rms < 0.98 * best.solution.held_out_rms) best = std::move(model);
  }
  return best;
}

Model best_model(const Data& data, const MatrixX2d& knots, const MapOptions& options) {
  constexpr int cubic = 3;  // beyond the dots the trend alone speaks: it must not be wild
  const Index n = data.raw.rows();
  if (options.order) return polynomial(data, *options.order);
  int highest = 1;
  while (highest < options.max_order && 2 * term_count(highest + 1) <= n) ++highest;
  if (options.remainder && highest >= cubic)
    return simplest_good(cubic, n > 200 ? std::min(highest, 5) : cubic,
                         [&](int order) { return smooth_model(data, order, knots); });
  return simplest_good(1, highest, [&](int order) { return polynomial(data, order); });
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
  data.variance = 1 / data.weights.mean();
  data.weights *= data.variance;
  return data;
}

/// For each dot the nearest others, nearest first.
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

/// Drops dots that their neighbours contradict, the gravest first (of many dots, several at a time). What
/// neighbours share is a bump of the screen.
void reject_outliers(const std::vector<Correspondence>& dots, const std::vector<Vector2d>& places,
                     const Frame& frame, std::vector<bool>& used) {
  const auto neighbours = neighbours_of(places);
  for (std::size_t round = 0; round < 10; ++round) {
    const Data data = gather(dots, places, frame, used);
    int order = 1;
    while (order < 4 && 3 * term_count(order + 1) <= data.raw.rows()) ++order;
    const Solution solution = polynomial(data, order).solution;
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
    map.kernel_sigma_px = model.sigma;
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
