// SPDX-License-Identifier: Apache-2.0
#include "helicarm/track/marker_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/LU>

#include "helicarm/detection/robust.h"
#include "helicarm/geometry/dense_matrix.h"
#include "helicarm/geometry/small_matrix.h"

namespace helicarm::track {
namespace {

constexpr Eigen::Index background_terms = 6, contrast_at = 6, place_at = 7, others_at = 9;
constexpr std::size_t most_others = 3;
constexpr double margin_px = 2.5, margin_share = 1.1;  // window beyond the radius
constexpr double bend = 0.06;  // rms of bone's curvature over the window, over a marker's contrast there

struct Pixels {
  Eigen::Vector2d origin;
  double window = 0;
  std::vector<double> x, y, grey;
};

std::optional<Pixels> pixels_around(const image::Image<float>& grey, const Eigen::Vector2d& at,
                                    double window) {
  Pixels made;
  made.window = window;
  const int u = int(std::lround(at.x())), v = int(std::lround(at.y())), half = int(std::ceil(window));
  made.origin = Eigen::Vector2d(u, v);
  if (!grey.contains(u - half, v - half) || !grey.contains(u + half, v + half)) return std::nullopt;
  for (int y = -half; y <= half; ++y)
    for (int x = -half; x <= half; ++x)
      if (std::hypot(u + x - at.x(), v + y - at.y()) <= window) {
        made.x.push_back(x);
        made.y.push_back(y);
        made.grey.push_back(double(grey(u + x, v + y)));
      }
  return made;
}

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 12, 12>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 12, 1>;
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Grey = B - f (c + h (B - b0)) - the neighbours, with B quadratic, f the marker's profile.
class WindowFit {
 public:
  WindowFit(const Pixels& pixels, const KnownMarker& marker, std::span<const KnownNeighbour> others,
            const MarkerAppearance& appearance)
      : pixels_(pixels),
        marker_(marker),
        appearance_(appearance),
        count_(Eigen::Index(pixels.x.size())),
        parameters_(others_at + Eigen::Index(others.size())),
        hides_(marker.contrast.is_known ? std::clamp(marker.contrast.share, 0.0, 3.0) : 0.4),
        rows_(count_, parameters_),
        residual_(count_),
        weight_(Eigen::VectorXd::Ones(count_)),
        p_(Vector::Zero(parameters_)) {
    for (const KnownNeighbour& other : others) {
      Eigen::VectorXd& drawn = others_.emplace_back(count_);
      for (Eigen::Index i = 0; i < count_; ++i)
        drawn[i] = -profile_at(other.at - pixels.origin, other.radius_px, i).value;
    }
  }

  Eigen::Vector2d place() const { return pixels_.origin + p_.segment<2>(place_at); }
  double contrast() const { return appearance_.polarity * p_[contrast_at]; }
  /// Without its prior. `variance`: of it with the prior.
  double contrast_by_pixels(double variance) const {
    if (!marker_.contrast.is_known) return contrast();
    const double prior = 1 / (prior_sigma() * prior_sigma()),
                 pixels = std::max(1e-3 * prior, 1 / variance - prior);
    return (contrast() / variance - expected() * prior) / pixels;
  }
  double background() const {
    const double x = p_[place_at] / pixels_.window, y = p_[place_at + 1] / pixels_.window;
    return p_[0] + p_[1] * x + p_[2] * y + p_[3] * x * x + p_[4] * x * y + p_[5] * y * y;
  }
  double squares() const { return residual_squares() + bend_pull() * p_.segment<3>(3).squaredNorm(); }
  double freedom() const { return std::max(1.0, weight_.sum() - double(parameters_)); }
  double noise() const { return residual_squares() / freedom(); }
  double used() const { return weight_.sum(); }

  /// Background and contrasts at a fixed place.
  bool fit_linear(const Eigen::Vector2d& at) {
    p_.setZero();
    p_.segment<2>(place_at) = at - pixels_.origin;
    p_[0] = mean();
    evaluate();
    for (int i = 0; i < 2; ++i)
      if (!step(true)) return false;
    return true;
  }

  /// Everything, from the state of `fit_linear`.
  bool fit(double farthest_px) {
    constexpr int iterations = 15;
    constexpr double enough_px = 2e-3, vague_px = 0.05, longest_px = 0.6;
    const Eigen::Vector2d start = p_.segment<2>(place_at);
    double moved = 1;
    for (int i = 0; i < iterations; ++i) {
      if (i > 2) reweight();
      const Eigen::Vector2d before = p_.segment<2>(place_at);
      if (!step(false, longest_px)) return false;
      if ((p_.segment<2>(place_at) - start).norm() > farthest_px) return false;
      moved = (p_.segment<2>(place_at) - before).norm();
      if (i > 4 && moved < enough_px) break;
    }
    return moved < vague_px;
  }

  /// Residual squares without the marker, at the same weights.
  double squares_without() const {
    const Eigen::Index n = parameters_ - 3;
    Rows rows(count_, n);
    for (Eigen::Index i = 0; i < count_; ++i) {
      rows.row(i).head<background_terms>() = terms(i);
      for (std::size_t k = 0; k < others_.size(); ++k)
        rows(i, background_terms + Eigen::Index(k)) = others_[k][i];
    }
    const Eigen::Map<const Eigen::VectorXd> grey(pixels_.grey.data(), count_);
    const Eigen::MatrixXd weighted = weight_.asDiagonal() * rows;
    Eigen::MatrixXd normal = rows.transpose() * weighted;
    normal.diagonal().array() += 1e-9;
    normal.diagonal().segment<3>(3).array() += bend_pull();
    const Eigen::VectorXd best = geometry::solve_spd(normal, weighted.transpose() * grey).solution;
    return (weight_.array() * (grey - rows * best).array().square()).sum() +
           bend_pull() * best.segment<3>(3).squaredNorm();
  }

  /// Covariance of contrast and place.
  Eigen::Matrix3d covariance() const {
    const Eigen::MatrixXd inverse = geometry::inverse(normal(false));
    return noise() * inverse.block<3, 3>(contrast_at, contrast_at);
  }

  /// Variance of the place, of both axes' mean, when each octant about it in turn is left out: what lies on
  /// one side of the marker alone, as the rim of a bone.
  double jackknife_variance() const {
    constexpr std::size_t octants = 8;
    const Eigen::MatrixXd inverse = geometry::inverse(normal(false));
    Eigen::Matrix<double, 2, octants> moved = Eigen::Matrix<double, 2, octants>::Zero(), shares = moved;
    for (Eigen::Index i = 0; i < count_; ++i) {
      const double x = pixels_.x[std::size_t(i)] - p_[place_at],
                   y = pixels_.y[std::size_t(i)] - p_[place_at + 1];
      const Eigen::Index octant = 4 * (y >= 0) + 2 * (x >= 0) + (std::abs(x) > std::abs(y));
      const Eigen::Vector2d influence =
          inverse.middleRows<2>(place_at) * rows_.row(i).transpose() * weight_[i];
      moved.col(octant) += influence * residual_[i];
      shares.col(octant) += influence.cwiseAbs2();
    }
    const Eigen::Array<double, 2, octants> share =
        (shares.array().colwise() / shares.rowwise().sum().array()).min(0.9);
    const Eigen::Matrix<double, 2, octants> steps = moved.array() / (1 - share);
    const double squares = (steps.colwise() - steps.rowwise().mean()).squaredNorm();
    return 0.5 * squares * double(octants - 1) / double(octants);
  }

  /// Of the contrast against its prior, in standard deviations, and that of the prior.
  double prior_off() const {
    return marker_.contrast.is_known ? (appearance_.polarity * p_[contrast_at] - expected()) / prior_sigma()
                                     : 0;
  }
  double prior_sigma() const { return marker_.contrast.spread * expected(); }

 private:
  struct Sample {
    double value;
    Eigen::Vector2d by_place;
  };
  Sample profile_at(const Eigen::Vector2d& at, double radius, Eigen::Index i) const {
    const Eigen::Vector2d off(pixels_.x[std::size_t(i)] - at.x(), pixels_.y[std::size_t(i)] - at.y());
    const double distance = off.norm() + 1e-12;
    const auto sample = appearance_.profile.at(float(distance / radius));
    return {double(sample.value), -double(sample.slope) / radius * off / distance};
  }
  Eigen::Matrix<double, 1, background_terms> terms(Eigen::Index i) const {
    const double x = pixels_.x[std::size_t(i)] / pixels_.window,
                 y = pixels_.y[std::size_t(i)] / pixels_.window;
    Eigen::Matrix<double, 1, background_terms> row;
    row << 1, x, y, x * x, x * y, y * y;
    return row;
  }
  double mean() const {
    double sum = 0;
    for (const double grey : pixels_.grey) sum += grey;
    return sum / double(count_);
  }
  double expected() const { return marker_.contrast.at(background()); }
  double residual_squares() const { return (weight_.array() * residual_.array().square()).sum(); }
  /// Weight of a curvature of zero: texture is a share of the radiation, as the contrast is.
  double bend_pull() const {
    return marker_.contrast.is_known ? noise() / std::pow(bend * expected(), 2) : 0;
  }

  void evaluate() {
    const double contrast = p_[contrast_at];
    for (Eigen::Index i = 0; i < count_; ++i) {
      const auto [f, slope] = profile_at(p_.segment<2>(place_at), marker_.radius_px, i);
      auto row = rows_.row(i);
      row.head<background_terms>() = terms(i);
      row.segment<background_terms - 1>(1) *= 1 - hides_ * f;
      row[contrast_at] = -f;
      const double varies = terms(i).tail<background_terms - 1>().dot(p_.segment<background_terms - 1>(1));
      row.segment<2>(place_at) = -(contrast + hides_ * varies) * slope.transpose();
      for (std::size_t k = 0; k < others_.size(); ++k) row[others_at + Eigen::Index(k)] = others_[k][i];
      residual_[i] = pixels_.grey[std::size_t(i)] -
                     row.head<background_terms>().dot(p_.head<background_terms>()) + contrast * f;
      for (std::size_t k = 0; k < others_.size(); ++k)
        residual_[i] -= p_[others_at + Eigen::Index(k)] * others_[k][i];
    }
  }

  Matrix normal(bool linear) const {
    Matrix made = rows_.transpose() * weight_.asDiagonal() * rows_;
    if (marker_.contrast.is_known) {
      const double pull = noise() / (prior_sigma() * prior_sigma());
      made(contrast_at, contrast_at) += pull;
      for (Eigen::Index i = 3; i < background_terms; ++i) made(i, i) += bend_pull();
    }
    if (linear)
      for (const Eigen::Index i : {place_at, place_at + 1}) made(i, i) += 1e30;
    made.diagonal().array() += 1e-9;
    return made;
  }

  bool step(bool linear, double longest_px = 0) {
    Vector right = rows_.transpose() * (weight_.asDiagonal() * residual_);
    if (marker_.contrast.is_known)
      right[contrast_at] +=
          noise() / (prior_sigma() * prior_sigma()) * (appearance_.polarity * expected() - p_[contrast_at]);
    right.segment<3>(3) -= bend_pull() * p_.segment<3>(3);
    if (linear) right.segment<2>(place_at).setZero();
    Vector moved = geometry::solve_spd(normal(linear), right).solution;
    if (!moved.allFinite()) return false;
    if (!linear) moved *= std::min(1.0, longest_px / std::max(1e-12, moved.segment<2>(place_at).norm()));
    p_ += moved;
    evaluate();
    return true;
  }

  /// Pixels that no model of the window explains; a wide cut, since Tukey's costs precision without them.
  void reweight() {
    constexpr double wider = 1.5, tolerance = 0.03;
    const double cut =
        wider * detection::tukey_cut(std::span<const double>(residual_.data(), std::size_t(count_)),
                                     tolerance * std::abs(p_[contrast_at]) + 1e-6);
    for (Eigen::Index i = 0; i < count_; ++i) weight_[i] = detection::tukey_weight(residual_[i], cut);
  }

  const Pixels& pixels_;
  const KnownMarker& marker_;
  const MarkerAppearance& appearance_;
  Eigen::Index count_, parameters_;
  double hides_;
  std::vector<Eigen::VectorXd> others_;
  Rows rows_;
  Eigen::VectorXd residual_, weight_;
  Vector p_;
};

/// Logarithm of the likelihood ratio of marker and background, of unknown noise, at the fitted place.
double evidence_of(const WindowFit& fit) {
  return 0.5 * fit.freedom() * std::log(fit.squares_without() / std::max(1e-12, fit.squares())) -
         0.5 * fit.prior_off() * fit.prior_off();
}

}  // namespace

std::optional<EvidentMarker> fit_known_marker(const image::Image<float>& grey, const KnownMarker& marker,
                                              std::span<const KnownNeighbour> others,
                                              const MarkerAppearance& appearance) {
  constexpr double step_px = 0.5, farthest_search_px = 4, sigmas = 2.5, nearest_px = 1.2, farthest_px = 1;
  const double window = margin_share * marker.radius_px + margin_px;
  std::vector<KnownNeighbour> near;
  for (const KnownNeighbour& other : others) {
    const double distance = (other.at - marker.at).norm();
    if (distance < nearest_px) return std::nullopt;
    if (distance < window + other.radius_px + 1.5 && near.size() < most_others) near.push_back(other);
  }
  Eigen::Vector2d start = marker.at;
  if (!marker.covariance.isZero()) {
    const double sigma = std::sqrt(marker.covariance.trace() / 2);
    const int reach = int(std::ceil(std::min(farthest_search_px, sigmas * sigma) / step_px));
    double most = -1e9;
    for (int j = -reach; j <= reach; ++j)
      for (int i = -reach; i <= reach; ++i) {
        const Eigen::Vector2d off(i * step_px, j * step_px);
        const double distance = geometry::squared_distance(off, marker.covariance);
        if (distance > sigmas * sigmas) continue;
        const auto pixels = pixels_around(grey, marker.at + off, window);
        if (!pixels) continue;
        WindowFit tried(*pixels, marker, near, appearance);
        if (!tried.fit_linear(marker.at + off) || tried.contrast() <= 0) continue;
        const double score = evidence_of(tried) - 0.5 * distance;
        if (score > most) most = score, start = marker.at + off;
      }
    if (most == -1e9) return std::nullopt;
  }
  const auto pixels = pixels_around(grey, start, window);
  if (!pixels) return std::nullopt;
  WindowFit fit(*pixels, marker, near, appearance);
  if (!fit.fit_linear(start) || !fit.fit(farthest_px) || !(fit.contrast() > 0)) return std::nullopt;
  const Eigen::Matrix3d covariance = fit.covariance();
  const Eigen::Matrix2d of_place = covariance.bottomRightCorner<2, 2>();
  EvidentMarker made;
  made.image.uv_raw = fit.place();
  made.image.sigma_px = std::sqrt(detection::prior_variance(of_place.trace() / 2, fit.jackknife_variance()));
  made.image.radius_px = marker.radius_px;
  made.image.contrast = appearance.polarity * fit.contrast_by_pixels(covariance(0, 0));
  made.image.background = fit.background();
  if (!std::isfinite(made.image.sigma_px)) return std::nullopt;
  made.evidence = evidence_of(fit);
  if (marker.contrast.is_known)
    made.evidence += 0.5 * std::log(covariance(0, 0) / std::pow(fit.prior_sigma(), 2));
  if (!marker.covariance.isZero()) {
    // The place is one of many in the window.
    const Eigen::Matrix2d spread = marker.covariance + of_place;
    made.evidence += 0.5 * std::log(of_place.determinant() / spread.determinant()) -
                     0.5 * geometry::squared_distance(fit.place() - marker.at, spread);
  }
  return made;
}

}  // namespace helicarm::track
