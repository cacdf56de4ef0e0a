// SPDX-License-Identifier: Apache-2.0
#include "helicarm/rectification/models/kriging.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/rectification/models/monomials.h"

namespace helicarm::rectification {
namespace {

using Eigen::Index;
using Eigen::MatrixX2d;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr std::size_t max_knots = 240;

/// The first points that are further than `gap` apart; nothing where they are more than `max_knots`.
std::vector<Vector2d> spread_by(double gap, const std::vector<Vector2d>& points) {
  std::vector<Vector2d> kept;
  for (const Vector2d& p : points) {
    if (!std::ranges::all_of(kept, [&](const Vector2d& q) { return (p - q).norm() > gap; })) continue;
    if (kept.size() == max_knots) return {};
    kept.push_back(p);
  }
  return kept;
}

/// A thinned, evenly spread subset of at most `max_knots` points.
MatrixX2d thinned(const std::vector<Vector2d>& points) {
  std::vector<Vector2d> kept;
  if (points.size() <= max_knots) kept = points;
  for (double gap = 0.05; kept.empty(); gap *= 1.05) kept = spread_by(gap, points);
  MatrixX2d knots(static_cast<Index>(kept.size()), 2);
  for (Index k = 0; k < knots.rows(); ++k) knots.row(k) = kept[static_cast<std::size_t>(k)].transpose();
  return knots;
}

/// Monomials, then the kernels at the knots.
VectorXd basis_row(const Vector2d& t, int order, const MatrixX2d& knots, double length) {
  const Index terms = term_count(order);
  VectorXd row(terms + knots.rows());
  row.head(terms) = monomials(t, order);
  const Eigen::ArrayXd s =
      ((knots.rowwise() - t.transpose()).rowwise().norm() * (std::sqrt(3.0) / length)).array();
  row.tail(knots.rows()) = (1 + s) * (-s).exp();
  return row;
}

/// Monomials of every dot, row by row.
MatrixXd trend_of_dots(const PlateDots& dots, int order) {
  return rows_for(dots, [&](const Vector2d& t) { return monomials(t, order); });
}

/// Kernels at the knots of every dot, column by column.
MatrixXd kernels_of_dots(const PlateDots& dots, const MatrixX2d& knots, double length) {
  MatrixXd kernels(dots.raw.rows(), knots.rows());
  const auto places = Eigen::Map<const Eigen::Matrix2Xd>(dots.points.front().data(), 2, kernels.rows());
  const Eigen::ArrayXd x = places.row(0).transpose(), y = places.row(1).transpose();
  for (Index k = 0; k < knots.rows(); ++k) {
    const Eigen::ArrayXd s =
        ((x - knots(k, 0)).square() + (y - knots(k, 1)).square()).sqrt() * (std::sqrt(3.0) / length);
    kernels.col(k) = (1 + s) * (-s).exp();
  }
  return kernels;
}

/// `basis_row` of every dot.
MatrixXd rows_of_dots(const PlateDots& dots, int order, const MatrixX2d& knots, double length) {
  const Index terms = term_count(order);
  MatrixXd rows(dots.raw.rows(), terms + knots.rows());
  rows.leftCols(terms) = trend_of_dots(dots, order);
  rows.rightCols(knots.rows()) = kernels_of_dots(dots, knots, length);
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

/// Maximum-likelihood estimate of the remainder's strength and the dots' noise.
struct Roughness {
  double length = 0;
  double gain = 0;      ///< remainder's variance relative to that of a dot of weight one
  double variance = 0;  ///< of a dot of weight one, px^2
  double misfit = std::numeric_limits<double>::infinity();  ///< -2 log of the restricted likelihood
};

constexpr std::array lengths = {0.14, 0.2, 0.28, 0.4, 0.57, 0.8, 1.1, 1.6, 2.2};

/// Restricted likelihood (Patterson and Thompson 1971) of remainders, with the trend projected out. What the
/// dots say of a length is kept: of trends up to the highest order, what is beyond a lower one is what is
/// beyond the highest and what lies along its other columns.
class Likelihood {
 public:
  Likelihood(const PlateDots& data, const MatrixX2d& knots, int highest)
      : data_(data),
        knots_(knots),
        root_(data.weights.cwiseSqrt()),
        trend_(geometry::orthonormal_columns(root_.asDiagonal() * trend_of_dots(data, highest))),
        beyond_(root_.asDiagonal() * data.raw),
        along_(trend_.transpose() * beyond_) {
    beyond_ -= trend_ * along_;
  }

  /// Maximised over gains; the dots' own sigmas are accepted within a factor of 1.5.
  Roughness at(int order, std::size_t length) {
    if (!known_[length]) known_[length] = kernels_of(lengths[length]);
    const Kernels& kernels = *known_[length];
    if (kernels.beyond.size() == 0) return {};
    const Index other = trend_.cols() - term_count(order);
    const auto across = kernels.along.bottomRows(other);
    const geometry::SymmetricEigen modes = geometry::symmetric_eigen(kernels.beyond + geometry::gram(across));
    const MatrixX2d pulls =
        modes.vectors.transpose() * (kernels.pulls + across.transpose() * along_.bottomRows(other));
    return likeliest_gain(lengths[length], beyond_.squaredNorm() + along_.bottomRows(other).squaredNorm(),
                          2.0 * double(trend_.rows() - term_count(order)), modes.values, pulls);
  }

 private:
  /// Kernels of one length at the dots, whitened: knots are the columns.
  struct Kernels {
    MatrixXd beyond;  ///< of those beyond the trend, their products; empty where they look alike
    MatrixXd along;   ///< along the trend's columns
    MatrixX2d pulls;  ///< products of those beyond the trend and the dots' places
  };

  Kernels kernels_of(double length) const {
    const auto whitens = geometry::whitening(gram_of(knots_, length));
    if (!whitens) return {};
    MatrixXd kernels = root_.asDiagonal() * kernels_of_dots(data_, knots_, length);
    const MatrixXd along = trend_.transpose() * kernels;
    kernels -= trend_ * along;
    return {*whitens * geometry::gram(kernels) * whitens->transpose(), along * whitens->transpose(),
            *whitens * (kernels.transpose() * beyond_)};
  }

  /// `energy`: of the places beyond the trend; `values`, `pulls`: eigenvalues of the kernels' products, and
  /// the products with the places along their eigenvectors.
  Roughness likeliest_gain(double length, double energy, double freedom, const VectorXd& values,
                           const MatrixX2d& pulls) const {
    constexpr double log_variance_sigma = 0.8;
    Roughness best;
    for (double gain = 1e-2; gain < 1e6; gain *= 1.5) {
      // y' (I + gain K K')^-1 y and log det (I + gain K K') for both axes, in the eigenbasis of K'K.
      double left = energy;
      double log_determinant = 0;
      for (Index k = 0; k < values.size(); ++k) {
        const double raised = 1 + gain * std::max(0.0, values[k]);
        left -= gain / raised * pulls.row(k).squaredNorm();
        log_determinant += 2 * std::log(raised);
      }
      left = std::max(left, 1e-12 * data_.variance);
      const auto misfit = [&](double log_variance) {
        const double surprise = (log_variance - std::log(data_.variance)) / log_variance_sigma;
        return freedom * log_variance + left * std::exp(-log_variance) + log_determinant +
               surprise * surprise;
      };
      double x = std::log(left / freedom);
      for (int i = 0; i < 20; ++i) {
        const double normal_prior = 2 / (log_variance_sigma * log_variance_sigma);
        const double pull = left * std::exp(-x);
        x -= std::clamp(
            (freedom - pull + normal_prior * (x - std::log(data_.variance))) / (pull + normal_prior), -1.0,
            1.0);
      }
      if (misfit(x) < best.misfit) best = {length, gain, std::exp(x), misfit(x)};
    }
    return best;
  }

  const PlateDots& data_;
  const MatrixX2d& knots_;
  VectorXd root_;     ///< of the dots' weights
  MatrixXd trend_;    ///< orthonormal columns that span the weighted monomials, of each order the first
  MatrixX2d beyond_;  ///< weighted places beyond the trend
  MatrixX2d along_;   ///< weighted places along the trend's columns
  std::array<std::optional<Kernels>, lengths.size()> known_;
};

/// Likelier than both neighbours in `lengths`, by descent of the misfit from `start`, which becomes its
/// index.
Roughness likeliest_near(std::size_t& start, Likelihood& likelihood, int order) {
  std::array<std::optional<Roughness>, lengths.size()> known;
  const auto at = [&](std::size_t i) -> const Roughness& {
    if (!known[i]) known[i] = likelihood.at(order, i);
    return *known[i];
  };
  // Where the kernels of a length look alike, shorter ones can.
  while (start > 0 && !std::isfinite(at(start).misfit)) --start;
  for (;;) {
    std::size_t best = start;
    if (start > 0 && at(start - 1).misfit < at(best).misfit) best = start - 1;
    if (start + 1 < lengths.size() && at(start + 1).misfit < at(best).misfit) best = start + 1;
    if (best == start) return at(start);
    start = best;
  }
}

/// Universal kriging. Length, strength and dot noise maximise the restricted likelihood, whose search begins
/// at the length of index `nearest`, and leaves there the index that it found.
ModelFit fit_order(const PlateDots& dots, int order, const MatrixX2d& knots, Likelihood& likelihood,
                   std::size_t& nearest) {
  const Roughness best = likeliest_near(nearest, likelihood, order);
  if (!(best.length > 0)) return {};
  const MatrixXd gram = gram_of(knots, best.length);
  const LinearFit fit = fit_linear(dots, rows_of_dots(dots, order, knots, best.length), gram / best.gain);
  if (fit.coefficients.size() == 0) return {};
  MatrixXd covariance = best.variance * fit.inverse;
  covariance.bottomRightCorner(gram.rows(), gram.cols()) -=
      best.gain * best.variance *
      geometry::solve_spd(gram, MatrixXd::Identity(gram.rows(), gram.cols())).solution;
  return {std::make_shared<KrigingModel>(Trend{order,
                                               {dots.normalised, fit.coefficients, std::move(covariance)},
                                               knots,
                                               best.length,
                                               std::sqrt(best.gain * best.variance)}),
          fit.held_out, fit.held_out_rms};
}

constexpr int cubic = 3;  // beyond the dots only the trend remains: it must extrapolate moderately

ModelFit kriging_fit(const PlateDots& dots, std::optional<int> order) {
  const Index n = dots.raw.rows();
  const int highest = n > 200 ? std::min(highest_order(n), 5) : cubic;
  if (highest_order(n) < order.value_or(cubic)) return {};
  const MatrixX2d knots = thinned(dots.points);
  Likelihood likelihood(dots, knots, order.value_or(highest));
  std::size_t nearest = lengths.size() / 2;
  return simplest_good(order.value_or(cubic), order.value_or(highest),
                       [&](int o) { return fit_order(dots, o, knots, likelihood, nearest); });
}

}  // namespace

double kernel(double squared_distance, double length) {
  const double s = std::sqrt(3 * squared_distance) / length;
  return (1 + s) * std::exp(-s);
}

Trend trend_through(const PlateDots& dots, int order) {
  constexpr double length = 0.57, least_noise = 1e-4;  // of the dots' variance over the remainder's
  const MatrixX2d knots = thinned(dots.points);
  const LinearFit fit =
      fit_linear(dots, rows_of_dots(dots, order, knots, length), least_noise * gram_of(knots, length));
  return {order, {dots.normalised, fit.coefficients, {}}, knots, length, 0};
}

VectorXd KrigingModel::basis(const Vector2d& t) const { return basis_row(t, order(), knots_, length_); }

MatrixX2d KrigingModel::slopes(const Vector2d& t) const {
  const Index terms = term_count(order());
  MatrixX2d slopes(terms + knots_.rows(), 2);
  slopes.topRows(terms) = monomial_slopes(t, order());
  const MatrixX2d away = -(knots_.rowwise() - t.transpose());
  const VectorXd steepness =
      -3 / (length_ * length_) * (-std::sqrt(3.0) / length_ * away.rowwise().norm().array()).exp();
  slopes.bottomRows(knots_.rows()) = steepness.asDiagonal() * away;
  return slopes;
}

double KrigingModel::prior_covariance(const Vector2d& p, const Vector2d& q) const {
  return sigma_px_ * sigma_px_ * kernel((p - q).squaredNorm(), length_);
}

void KrigingModel::write(Json& json) const {
  write_trend({order(), terms(), knots_, length_, sigma_px_}, json);
}

void write_trend(const Trend& trend, Json& json) {
  const MatrixX2d& all = trend.terms.coefficients;
  json["order"] = trend.order;
  write_coefficients(trend.terms.normalised, all.topRows(all.rows() - trend.knots.rows()), json);
  json["kernel"] = "matern-3/2";
  json["kernel_length"] = trend.length;
  json["kernel_sigma_px"] = trend.sigma_px;
  json["knots"] = rows_of(trend.knots);
  json["weights"] = rows_of(all.bottomRows(trend.knots.rows()));
  json["covariance"] = rows_of(trend.terms.covariance);
}

ModelPointer read_trend(JsonReader& reader) {
  Trend trend;
  trend.order = reader.integer("order", 0, 9);
  trend.terms = read_coefficients(reader);
  reader.choice("kernel", {"matern-3/2"});
  trend.length = reader.number("kernel_length", {0, 1e3});
  trend.sigma_px = reader.number("kernel_sigma_px", {0, 1e4});
  trend.knots = matrix_of(reader, "knots", 2, 2000);
  const MatrixXd weights = matrix_of(reader, "weights", 2, 2000);
  MatrixX2d& coefficients = trend.terms.coefficients;
  if (trend.order > 0 && coefficients.rows() != term_count(trend.order))
    reader.refuse(Reason::bad_value, "coefficients", "do not match the order");
  if (weights.rows() != trend.knots.rows())
    reader.refuse(Reason::bad_value, "weights", "do not match the knots");
  if (trend.knots.rows() > 0 && !(trend.length > 0))
    reader.refuse(Reason::bad_value, "kernel_length", "must be positive where there are knots");
  trend.terms.covariance = read_covariance(reader, coefficients.rows() + weights.rows());
  if (trend.order == 0) return identity_model();
  if (weights.rows() == 0) return std::make_shared<PolynomialModel>(trend.order, std::move(trend.terms));
  coefficients.conservativeResize(coefficients.rows() + weights.rows(), 2);
  coefficients.bottomRows(weights.rows()) = weights;
  return std::make_shared<KrigingModel>(std::move(trend));
}

ModelKind kriging_kind() { return {"kriging", 2 * term_count(cubic), kriging_fit, read_trend}; }

}  // namespace helicarm::rectification
