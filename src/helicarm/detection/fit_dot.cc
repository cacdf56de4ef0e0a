// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/fit_dot.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>

#include "helicarm/detection/dot_model.h"
#include "helicarm/detection/dot_patch.h"
#include "helicarm/detection/robust.h"

namespace helicarm::detection {
namespace {

using Eigen::Index;
using Normal = DotModel::Normal;
using Parameters = DotModel::Parameters;
using Vector = DotModel::Vector;

constexpr double least_contrast = 1e-4;  ///< relative to the patch's mean: rounding errors dominate below

/// Tukey's weights. The pixels' spread is taken as at least `least`.
float reweight(DotPatch& patch, const DotModel& model, float least) {
  const std::span residuals(model.residual(), static_cast<std::size_t>(patch.count));
  const float cut = tukey_cut(residuals, std::max(least, 1e-6f));
  for (std::size_t i = 0; i < residuals.size(); ++i)
    patch.weight[i] = patch.clipped[i] && residuals[i] == 0 ? 0 : tukey_weight(residuals[i], cut);
  return cut;
}

/// Priors of the hidden share and of the overlap terms, as additional observations. Returns their
/// contribution to the normal matrix' diagonal.
Vector add_priors(DotSums& sums, const DotModel& model, const Parameters& p, const DotFitOptions& options) {
  const double weight = sums.normal(0, 0);  // of the background's level: every pixel counts once
  const double noise = sums.squares / std::max(1.0, weight - double(p.size()));
  Vector pull = Vector::Zero(p.size());
  const auto add = [&](Index k, double mean, double sigma) {
    pull[k] = noise / (sigma * sigma);
    sums.normal(k, k) += pull[k];
    sums.right[k] += pull[k] * (mean - double(p[k]));
  };
  add(DotModel::hidden, options.hidden_share, options.hidden_sigma);
  for (std::size_t j = 0; j < model.dots(); ++j)
    for (std::size_t i = 0; i < j; ++i) {
      // 0 in a logarithmic image, the product of both shares in a linear one.
      const double both =
          double(p[DotModel::contrast_of(i)]) * double(p[DotModel::contrast_of(j)]) / double(p[0]);
      add(model.overlap_of(i, j), 0.5 * both, std::abs(both) + 1e-6);
    }
  return pull;
}

/// Variances of a centre, averaged over both axes.
struct CentreError {
  double by_noise;
  double jackknife;
};

/// Spread of a centre when each octant in turn is left out (delete-a-group jackknife; `pulls`: each pixel's
/// contribution to a coordinate of the centre, `shares`: to the information about it). Detects one-sided
/// disturbances such as a wire or a shutter across the dot.
double jackknife_variance(const DotPatch& patch, const Eigen::ArrayXf& pulls, const Eigen::ArrayXf& shares) {
  constexpr double groups = DotPatch::octants;
  const double all = double(shares.sum());
  double sum = 0;
  double squares = 0;
  for (std::size_t k = 0; k < DotPatch::octants; ++k) {
    const Index first = patch.octant_start[k];
    const Index count = patch.octant_start[k + 1] - first;
    if (count == 0) continue;
    const double share = std::min(0.9, double(shares.segment(first, count).sum()) / all);
    const double step = double(pulls.segment(first, count).sum()) / (1 - share);
    sum += step;
    squares += step * step;
  }
  return (groups - 1) / groups * (squares - sum * sum / groups);
}

/// Errors of each dot's centre in a fit with Tukey's weights (Huber 1981) under noise that is correlated
/// between pixels and differs behind a dot.
std::vector<CentreError> centre_errors(const DotModel& model, const DotPatch& patch, const DotSums& sums,
                                       const Vector& pull, float cut, const NoiseCorrelation& noise) {
  using Array = Eigen::Map<const Eigen::ArrayXf>;
  const auto n = static_cast<Index>(patch.weight.size());  // padding pixels have no weight
  const Array weight(patch.weight.data(), n);
  const Array residual(model.residual(), n);
  Eigen::ArrayXf behind = Eigen::ArrayXf::Zero(n);
  for (std::size_t k = 0; k < model.dots(); ++k)
    behind -= Array(model.rows.row(DotModel::contrast_of(k)).data(), n);
  const Eigen::ArrayXf counts = (weight > 0).cast<float>();
  const Eigen::ArrayXf pulls = (weight * residual).square();
  const Eigen::ArrayXf t = (residual / cut).square();
  const double used = double(counts.sum());
  const double slopes = double((counts * (1 - t) * (1 - 5 * t)).sum());  // d weighted residual / d residual
  const double squares = double(pulls.sum());
  const double mean = squares / used;
  // Linear fit of the squared weighted residuals.
  Eigen::Matrix2d sides;
  const double behind_sum = double((counts * behind).sum());
  sides << used, behind_sum, behind_sum, double((counts * behind.square()).sum());
  const Eigen::Vector2d line = sides.ldlt().solve(Eigen::Vector2d(squares, double((pulls * behind).sum())));
  const Eigen::ArrayXf level =
      ((float(line[0]) + float(line[1]) * behind) / float(mean)).max(0.1f).sqrt() * weight;

  const Index parameters = model.parameters();
  const Normal inverse = sums.normal.llt().solve(Normal::Identity(parameters, parameters));
  // Influence of each pixel on the centres.
  PixelRows influence(2 * static_cast<Index>(model.dots()), n);
  Eigen::VectorXd by_priors(influence.rows());
  Eigen::VectorXd jackknife(influence.rows());
  for (Index row = 0; row < influence.rows(); ++row) {
    const Vector of_centre =
        inverse.col(DotModel::contrast_of(static_cast<std::size_t>(row / 2)) + 1 + row % 2);
    influence.row(row) = of_centre.cast<float>().transpose() * model.rows.topRows(parameters);
    by_priors[row] = of_centre.cwiseAbs2().dot(pull);
    const Eigen::ArrayXf weighted = influence.row(row).transpose().array() * weight;
    jackknife[row] =
        jackknife_variance(patch, weighted * residual, weighted * influence.row(row).transpose().array());
  }
  influence.array().rowwise() *= level.transpose();
  const Eigen::MatrixXd spread = correlated_normal(noise, influence, patch.cell, patch.side);
  const Eigen::MatrixXd white = correlated_normal({}, influence, patch.cell, patch.side);
  // Variance absorbed by the fit's parameters; larger for correlated noise.
  const double freedom = double(parameters) * spread.trace() / white.trace();
  const double variance = squares / std::max(0.1 * used, used - freedom) * (used * used) / (slopes * slopes);
  std::vector<CentreError> errors;
  for (Index row = 0; row < influence.rows(); row += 2)
    errors.push_back(
        {0.5 * variance * (spread(row, row) + spread(row + 1, row + 1) + by_priors.segment<2>(row).sum()),
         0.5 * jackknife.segment<2>(row).sum()});
  return errors;
}

}  // namespace

std::optional<Dot> fit_dot(const image::Image<float>& image, const Dot& start, const BallProfile& profile,
                           std::span<const Disc> others, const DotFitOptions& options) {
  const auto dots = fit_dots_together(image, {&start, 1}, {&profile, 1}, others, options);
  return dots ? std::optional(dots->front()) : std::nullopt;
}

std::optional<std::vector<Dot>> fit_dots_together(const image::Image<float>& image,
                                                  std::span<const Dot> starts,
                                                  std::span<const BallProfile> profiles,
                                                  std::span<const Disc> others,
                                                  const DotFitOptions& options) {
  if (starts.empty() || starts.size() > max_dots_together || starts.size() != profiles.size())
    throw std::invalid_argument("fit_dots_together: one to four dots, a profile for each");
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Dot& start : starts) middle += start.centre_px / double(starts.size());
  const int u = static_cast<int>(std::lround(middle.x()));
  const int v = static_cast<int>(std::lround(middle.y()));
  std::vector<Disc> windows;
  for (const Dot& start : starts) {
    if (!image.contains(static_cast<int>(std::lround(start.centre_px.x())),
                        static_cast<int>(std::lround(start.centre_px.y()))) ||
        !(start.radius_px > 0.5))
      return std::nullopt;
    windows.push_back({start.centre_px - Eigen::Vector2d(u, v),
                       start.radius_px * (1 + options.margin_share) + options.margin_px});
  }
  auto patch = gather_dot_patch(image, u, v, windows, others, options);
  if (!patch) return std::nullopt;

  DotModel model(profiles, *patch);
  const Index n = model.parameters();
  Parameters p = Parameters::Zero(n);
  p[0] = 1;
  p[DotModel::hidden] = float(options.hidden_share);
  for (std::size_t k = 0; k < starts.size(); ++k)
    p.segment<3>(DotModel::contrast_of(k) + 1) << windows[k].centre.cast<float>(), float(starts[k].radius_px);

  Vector pull;
  const auto equations = [&](bool linear) {
    DotSums sums = accumulate(model, *patch);
    pull = add_priors(sums, model, p, options);
    const auto hold = [&](Index k) {
      sums.normal(k, k) += 1e30;
      sums.right[k] = 0;
    };
    for (std::size_t k = 0; k < starts.size(); ++k) {
      const Index contrast = DotModel::contrast_of(k);
      if (linear)
        for (const Index i : {1, 2}) hold(contrast + i);
      if (linear || !options.free_radius) hold(contrast + 3);
    }
    if (linear) hold(DotModel::hidden);
    return sums;
  };
  // First a linear fit of background and contrasts at the given positions.
  model.evaluate(*patch, p);
  DotSums sums = equations(true);
  p += sums.normal.llt().solve(sums.right).cast<float>();
  if (!p.allFinite()) return std::nullopt;

  float cut = 0;
  double move = 1e9;
  for (int i = 0;; ++i) {
    model.evaluate(*patch, p);
    double contrast = 0;
    for (std::size_t k = 0; k < starts.size(); ++k)
      contrast = std::max(contrast, double(std::abs(p[DotModel::contrast_of(k)])));
    const double roughness = options.rough * std::pow(0.5, i);
    const double tolerance = std::max(options.tolerance, roughness);
    cut = reweight(*patch, model, float(tolerance * contrast));
    sums = equations(false);
    if ((roughness < options.tolerance && move < 4e-3) || i == options.iterations) break;
    const Vector step = sums.normal.llt().solve(sums.right);
    if (!step.allFinite()) return std::nullopt;
    double share = 1;
    move = 0;
    for (std::size_t k = 0; k < starts.size(); ++k) {
      const Index contrast_index = DotModel::contrast_of(k);
      const double moved = step.segment<2>(contrast_index + 1).norm();
      const double longest = std::max({moved, std::abs(step[contrast_index + 3]), 1e-12});
      share = std::min(share, 0.35 * starts[k].radius_px / longest);
      move = std::max(move, moved);
    }
    p += float(share) * step.cast<float>();
    for (std::size_t k = 0; k < starts.size(); ++k) {
      const Index contrast_index = DotModel::contrast_of(k);
      const double ratio = double(p[contrast_index + 3]) / starts[k].radius_px;
      const Eigen::Vector2d centre = p.segment<2>(contrast_index + 1).cast<double>();
      if (!(ratio > 0.5 && ratio < 1.8) || (centre - windows[k].centre).norm() > windows[k].radius)
        return std::nullopt;
    }
  }
  if (move > 0.05) return std::nullopt;

  const auto errors = centre_errors(model, *patch, sums, pull, cut, options.noise);
  double squares = 0;
  for (Index i = 0; i < patch->count; ++i) {
    const double residual = double(model.residual()[i]);
    squares += residual * residual;
  }
  std::vector<Dot> dots;
  for (std::size_t k = 0; k < starts.size(); ++k) {
    const Index contrast_index = DotModel::contrast_of(k);
    const double contrast = double(p[contrast_index]);
    if (!(std::abs(contrast) > least_contrast)) return std::nullopt;
    Dot dot;
    dot.centre_px = Eigen::Vector2d(u, v) + p.segment<2>(contrast_index + 1).cast<double>();
    dot.radius_px = double(p[contrast_index + 3]);
    dot.sigma_px = std::sqrt(errors[k].by_noise);
    dot.jackknife_px = std::sqrt(errors[k].jackknife);
    dot.contrast = contrast * double(patch->scale);
    dot.misfit = std::sqrt(squares / double(patch->count)) / std::abs(contrast);
    if (!dot.centre_px.allFinite() || !std::isfinite(dot.sigma_px)) return std::nullopt;
    dots.push_back(dot);
  }
  return dots;
}

}  // namespace helicarm::detection
