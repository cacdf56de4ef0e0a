// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/fit_dot.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include <Eigen/Cholesky>

#include "helicarm/detection/robust.h"

namespace helicarm {
namespace {

using Eigen::Index;

/// Parameters: background b0 bx by bxx bxy byy (patch coordinates in units of the window) and the hidden
/// share; contrast, centre, radius of each dot; what the absorptions of each two dots have in common.
constexpr Index n_background = 6;
constexpr Index hidden = 6;
constexpr Index of_dot = 7;
constexpr Index per_dot = 4;
constexpr Index max_parameters =
    of_dot + per_dot * max_dots_together + max_dots_together * (max_dots_together - 1) / 2;
constexpr double least_contrast = 1e-4;  ///< as a share of the patch's mean: below, rounding errors speak
using Parameters = Eigen::Matrix<float, Eigen::Dynamic, 1, 0, max_parameters, 1>;
using Normal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_parameters, max_parameters>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_parameters, 1>;

/// Aligned, so that sums add up in the same order wherever they lie.
using Floats = std::vector<float, Eigen::aligned_allocator<float>>;

/// The pixels around the dots as columns, filled up with weightless ones to a multiple of the registers'
/// width.
struct Patch {
  Index count = 0;
  Floats x, y;  ///< from the patch's origin, px
  Floats grey, weight;
  std::vector<char> clipped;  ///< the true value is at least `grey`
  std::vector<int> cell;      ///< place in a grid of width `side`
  int side = 0;
  float inverse_window = 0;
  float scale = 1;  ///< grey values are divided by it
};

struct Model {
  std::span<const BallProfile> profiles;
  PixelRows rows;  ///< the model's derivatives
  Floats residual, open, scratch;

  std::size_t dots() const { return profiles.size(); }
  static Index contrast_of(std::size_t dot) { return of_dot + per_dot * static_cast<Index>(dot); }
};

Index overlap_of(const Model& model, std::size_t i, std::size_t j) {  // i < j
  return Model::contrast_of(model.dots()) + static_cast<Index>(j * (j - 1) / 2 + i);
}

void prepare(Model& model, const Patch& patch) {
  const std::size_t n = patch.x.size();
  const auto pairs = static_cast<Index>(model.dots() * (model.dots() - 1) / 2);
  model.rows.resize(Model::contrast_of(model.dots()) + pairs, static_cast<Index>(n));
  model.residual.resize(n);
  model.open.resize(n);
  model.scratch.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const float x = patch.x[i] * patch.inverse_window;
    const float y = patch.y[i] * patch.inverse_window;
    const auto column = static_cast<Index>(i);
    model.rows(0, column) = 1;
    model.rows(3, column) = x * x;
    model.rows(4, column) = x * y;
    model.rows(5, column) = y * y;
  }
}

/// One dot's profile (negative) and its derivatives, not yet multiplied by what they change.
void draw_dot(Model& model, const Patch& patch, const Parameters& p, std::size_t dot) {
  const Index k = Model::contrast_of(dot);
  const BallProfile& profile = model.profiles[dot];
  const float u = p[k + 1];
  const float v = p[k + 2];
  const float per_radius = 1 / p[k + 3];
  const std::size_t n = patch.x.size();
  const float* __restrict xs = patch.x.data();
  const float* __restrict ys = patch.y.data();
  float* __restrict covered = model.rows.row(k).data();
  float* __restrict by_u = model.rows.row(k + 1).data();
  float* __restrict by_v = model.rows.row(k + 2).data();
  float* __restrict by_radius = model.rows.row(k + 3).data();
  for (std::size_t i = 0; i < n; ++i) {
    const float dx = xs[i] - u;
    const float dy = ys[i] - v;
    const float distance = std::sqrt(dx * dx + dy * dy + 1e-8f);
    const auto sample = profile.at(distance * per_radius);
    const float steep = sample.slope * per_radius;
    covered[i] = -sample.value;
    by_u[i] = -steep * dx / distance;
    by_v[i] = -steep * dy / distance;
    by_radius[i] = -steep * distance * per_radius;
  }
}

/// Residuals and derivatives at the given parameters.
void evaluate(Model& model, const Patch& patch, const Parameters& p) {
  const std::size_t n = patch.x.size();
  const std::size_t dots = model.dots();
  for (std::size_t k = 0; k < dots; ++k) draw_dot(model, patch, p, k);
  const auto row = [&](Index k) { return model.rows.row(k).data(); };
  float* __restrict residual = model.residual.data();
  float* __restrict open = model.open.data();
  std::fill(model.open.begin(), model.open.end(), 1.0f);
  for (std::size_t k = 0; k < dots; ++k) {
    const float* __restrict covered = row(Model::contrast_of(k));
    for (std::size_t i = 0; i < n; ++i) open[i] *= 1 + covered[i];
  }
  {
    const float* __restrict xs = patch.x.data();
    const float* __restrict ys = patch.y.data();
    const float* __restrict grey = patch.grey.data();
    const float* __restrict xx = row(3);
    const float* __restrict xy = row(4);
    const float* __restrict yy = row(5);
    float* __restrict by_bx = row(1);
    float* __restrict by_by = row(2);
    float* __restrict by_hidden = row(hidden);
    for (std::size_t i = 0; i < n; ++i) {
      const float x = xs[i] * patch.inverse_window;
      const float y = ys[i] * patch.inverse_window;
      const float slant = p[1] * x + p[2] * y;
      const float shut = 1 - open[i];
      const float seen = 1 - p[hidden] * shut;
      by_bx[i] = x * seen;
      by_by[i] = y * seen;
      by_hidden[i] = -slant * shut;
      residual[i] = grey[i] - (p[0] + slant * seen + p[3] * xx[i] + p[4] * xy[i] + p[5] * yy[i]);
    }
  }
  for (std::size_t j = 0; j < dots; ++j)
    for (std::size_t i = 0; i < j; ++i) {
      const Index pair = overlap_of(model, i, j);
      const float* a = row(Model::contrast_of(i));
      const float* b = row(Model::contrast_of(j));
      float* common = row(pair);
      for (std::size_t m = 0; m < n; ++m) {
        common[m] = a[m] * b[m];
        residual[m] -= p[pair] * common[m];
      }
    }
  for (std::size_t k = 0; k < dots; ++k) {
    const Index contrast = Model::contrast_of(k);
    const float* __restrict covered = row(contrast);
    float* __restrict change = model.scratch.data();  // of the model by this dot's profile
    for (std::size_t i = 0; i < n; ++i) {
      residual[i] -= p[contrast] * covered[i];
      change[i] = -p[contrast];
    }
    for (std::size_t i = 0; i < n; ++i) open[i] = p[1] * patch.x[i] + p[2] * patch.y[i];
    for (std::size_t other = 0; other < dots; ++other) {
      if (other == k) continue;
      const float* beside = row(Model::contrast_of(other));
      const float common = p[overlap_of(model, std::min(k, other), std::max(k, other))];
      for (std::size_t i = 0; i < n; ++i) {
        change[i] -= common * beside[i];
        open[i] *= 1 + beside[i];
      }
    }
    const float hides = p[hidden] * patch.inverse_window;
    float* __restrict by_u = row(contrast + 1);
    float* __restrict by_v = row(contrast + 2);
    float* __restrict by_radius = row(contrast + 3);
    for (std::size_t i = 0; i < n; ++i) {
      const float height = change[i] - hides * open[i];
      by_u[i] *= height;
      by_v[i] *= height;
      by_radius[i] *= height;
    }
  }
  for (std::size_t i = 0; i < n; ++i)
    if (patch.clipped[i] && residual[i] < 0) residual[i] = 0;
}

/// Tukey's weights. The pixels' spread is taken as `least` at least.
float reweight(Patch& patch, const Model& model, float least) {
  const std::span residuals(model.residual.data(), static_cast<std::size_t>(patch.count));
  const float cut = tukey_cut(residuals, std::max(least, 1e-6f));
  for (std::size_t i = 0; i < residuals.size(); ++i)
    patch.weight[i] = patch.clipped[i] && residuals[i] == 0 ? 0 : tukey_weight(residuals[i], cut);
  return cut;
}

struct Sums {
  Normal normal;
  Vector right;
  Vector pull;   ///< what the priors add to the normal matrix' diagonal
  double noise;  ///< variance of a pixel
};

Sums accumulate(const Model& model, const Patch& patch) {
  constexpr Index block = 256;
  alignas(32) float weighted[block];
  const Index n = model.rows.rows();
  Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, 0, max_parameters, max_parameters> normal(n, n);
  Parameters right(n);
  normal.setZero();
  right.setZero();
  using Column = Eigen::Map<const Eigen::VectorXf>;
  double squares = 0;
  double weight = 0;
  for (Index start = 0; start < model.rows.cols(); start += block) {
    const Index size = std::min(block, model.rows.cols() - start);
    const Column weights(patch.weight.data() + start, size);
    const Column residual(model.residual.data() + start, size);
    Eigen::Map<Eigen::VectorXf> left(weighted, size);
    for (Index a = 0; a < n; ++a) {
      left = weights.cwiseProduct(model.rows.row(a).segment(start, size).transpose());
      for (Index b = a; b < n; ++b) normal(b, a) += left.dot(Column(&model.rows(b, start), size));
      right[a] += left.dot(residual);
    }
    squares += double(weights.cwiseProduct(residual).dot(residual));
    weight += double(weights.sum());
  }
  Sums sums;
  sums.normal = normal.cast<double>().selfadjointView<Eigen::Lower>();
  sums.right = right.cast<double>();
  sums.noise = squares / std::max(1.0, weight - double(n));
  return sums;
}

/// What is known beforehand of the hidden share and of what overlapping dots have in common, as so many more
/// observations.
void add_priors(Sums& sums, const Model& model, const Parameters& p, const DotFitOptions& options) {
  const auto add = [&](Index k, double mean, double sigma) {
    sums.pull[k] = sums.noise / (sigma * sigma);
    sums.normal(k, k) += sums.pull[k];
    sums.right[k] += sums.pull[k] * (mean - double(p[k]));
  };
  sums.pull = Vector::Zero(p.size());
  add(hidden, options.hidden_share, options.hidden_sigma);
  for (std::size_t j = 0; j < model.dots(); ++j)
    for (std::size_t i = 0; i < j; ++i) {
      // Nothing in a logarithmic picture, the product of both shares in a linear one.
      const double both = double(p[Model::contrast_of(i)]) * double(p[Model::contrast_of(j)]) / double(p[0]);
      add(overlap_of(model, i, j), 0.5 * both, std::abs(both) + 1e-6);
    }
}

std::optional<Patch> gather(const Image<float>& image, int u, int v, std::span<const Disc> windows,
                            std::span<const Disc> others, const DotFitOptions& options) {
  Patch patch;
  double window = 0;
  for (const Disc& disc : windows) window = std::max(window, disc.centre.norm() + disc.radius);
  patch.inverse_window = float(1 / window);
  const int half = static_cast<int>(std::ceil(window));
  patch.side = 2 * half + 1;
  std::vector<Disc> near;
  for (const Disc& disc : others)
    if (std::hypot(disc.centre.x() - u, disc.centre.y() - v) < window + disc.radius)
      near.push_back({disc.centre - Eigen::Vector2d(u, v), disc.radius});
  const auto within = [](const std::vector<Disc>& discs, double x, double y) {
    return std::any_of(discs.begin(), discs.end(), [&](const Disc& disc) {
      const double dx = x - disc.centre.x();
      const double dy = y - disc.centre.y();
      return dx * dx + dy * dy <= disc.radius * disc.radius;
    });
  };
  const std::vector<Disc> wanted(windows.begin(), windows.end());
  const auto most = static_cast<std::size_t>(patch.side * patch.side + 8);
  for (auto* column : {&patch.x, &patch.y, &patch.grey}) column->reserve(most);
  patch.clipped.reserve(most);
  patch.cell.reserve(most);
  int inside = 0;
  int open = 0;
  double sum = 0;
  for (int y = -half; y <= half; ++y)
    for (int x = -half; x <= half; ++x) {
      if (!within(wanted, x, y)) continue;
      ++inside;
      if (!image.contains(u + x, v + y)) continue;
      const float grey = image(u + x, v + y);
      if (grey <= options.floor || within(near, x, y)) continue;
      const bool clipped = grey >= options.ceiling;
      patch.x.push_back(float(x));
      patch.y.push_back(float(y));
      patch.grey.push_back(grey);
      patch.clipped.push_back(clipped);
      patch.cell.push_back((y + half) * patch.side + x + half);
      open += !clipped;
      sum += double(grey);
    }
  const std::size_t count = patch.x.size();
  if (open < 30 || double(count) < 0.4 * inside) return std::nullopt;
  patch.count = static_cast<Index>(count);
  patch.scale = std::max(1e-3f, float(std::abs(sum)) / float(count));
  for (float& grey : patch.grey) grey /= patch.scale;
  patch.weight.assign(count, 1);
  const std::size_t whole = (count + 7) / 8 * 8;
  for (auto* column : {&patch.x, &patch.y, &patch.grey, &patch.weight}) column->resize(whole, 0);
  patch.clipped.resize(whole, 0);
  return patch;
}

/// Covariance of a fit with Tukey's weights (Huber 1981) to noise that neighbours share and that is another
/// behind a dot: the normal matrix' inverse on both sides of what the noise does to the right side.
Normal covariance_of(const Model& model, const Patch& patch, const Sums& sums, float cut,
                     const NoiseCorrelation& noise) {
  const auto n = static_cast<std::size_t>(patch.count);
  const auto behind = [&](std::size_t i) {
    double sum = 0;
    for (std::size_t k = 0; k < model.dots(); ++k)
      sum -= double(model.rows(Model::contrast_of(k), static_cast<Index>(i)));
    return sum;
  };
  double weights = 0;
  double slopes = 0;  // of the weighted residual by the residual
  double used = 0;
  Eigen::Matrix2d sides = Eigen::Matrix2d::Zero();  // straight line through the weighted residuals' squares
  Eigen::Vector2d squares = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const double weight = double(patch.weight[i]);
    if (weight == 0) continue;
    const double pull = weight * double(model.residual[i]);
    const double t = double(model.residual[i] / cut);
    const Eigen::Vector2d side(1, behind(i));
    sides += side * side.transpose();
    squares += pull * pull * side;
    weights += weight;
    slopes += (1 - t * t) * (1 - 5 * t * t);
    used += 1;
  }
  const double mean = squares[0] / used;
  const Eigen::Vector2d line = sides.ldlt().solve(squares);
  PixelRows weighted = model.rows.leftCols(patch.count);
  for (std::size_t i = 0; i < n; ++i) {
    const double level = std::max(0.1, (line[0] + line[1] * behind(i)) / mean);
    weighted.col(static_cast<Index>(i)) *= patch.weight[i] * float(std::sqrt(level));
  }
  const Normal inverse = sums.normal.ldlt().solve(Normal::Identity(sums.normal.rows(), sums.normal.rows()));
  Normal between = correlated_normal(noise, weighted, patch.cell, patch.side);
  const double freedom = (inverse * between).trace() * used / weights;
  const double variance =
      squares[0] / std::max(0.1 * used, used - freedom) * (used * used) / (slopes * slopes);
  between.diagonal() += sums.pull;
  return variance * (inverse * between * inverse);
}

}  // namespace

std::optional<Dot> fit_dot(const Image<float>& image, const Dot& start, const BallProfile& profile,
                           std::span<const Disc> others, const DotFitOptions& options) {
  const auto dots = fit_dots_together(image, {&start, 1}, {&profile, 1}, others, options);
  return dots ? std::optional(dots->front()) : std::nullopt;
}

std::optional<std::vector<Dot>> fit_dots_together(const Image<float>& image, std::span<const Dot> starts,
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
  auto patch = gather(image, u, v, windows, others, options);
  if (!patch) return std::nullopt;

  Model model{profiles, {}, {}, {}, {}};
  prepare(model, *patch);
  const Index n = model.rows.rows();
  Parameters p = Parameters::Zero(n);
  p[0] = 1;
  p[hidden] = float(options.hidden_share);
  for (std::size_t k = 0; k < starts.size(); ++k)
    p.segment<3>(Model::contrast_of(k) + 1) << windows[k].centre.cast<float>(), float(starts[k].radius_px);

  const auto solve = [&](Sums sums, bool linear) {
    add_priors(sums, model, p, options);
    const auto hold = [&](Index k) {
      sums.normal(k, k) += 1e30;
      sums.right[k] = 0;
    };
    for (std::size_t k = 0; k < starts.size(); ++k) {
      const Index contrast = Model::contrast_of(k);
      if (linear)
        for (const Index i : {1, 2}) hold(contrast + i);
      if (linear || !options.free_radius) hold(contrast + 3);
    }
    if (linear) hold(hidden);
    return sums;
  };
  // Background and contrasts first, at the given places.
  evaluate(model, *patch, p);
  Sums sums = solve(accumulate(model, *patch), true);
  p += sums.normal.ldlt().solve(sums.right).cast<float>();
  if (!p.allFinite()) return std::nullopt;

  float cut = 0;
  double move = 1e9;
  for (int i = 0;; ++i) {
    evaluate(model, *patch, p);
    double contrast = 0;
    for (std::size_t k = 0; k < starts.size(); ++k)
      contrast = std::max(contrast, double(std::abs(p[Model::contrast_of(k)])));
    // Outliers are told from a rough start only by and by.
    const double tolerance = std::max(options.tolerance, 0.3 * std::pow(0.5, i));
    cut = reweight(*patch, model, float(tolerance * contrast));
    sums = solve(accumulate(model, *patch), false);
    if ((i >= 4 && move < 2e-3) || i == options.iterations) break;
    const Vector step = sums.normal.ldlt().solve(sums.right);
    if (!step.allFinite()) return std::nullopt;
    double share = 1;
    move = 0;
    for (std::size_t k = 0; k < starts.size(); ++k) {
      const Index contrast_index = Model::contrast_of(k);
      const double moved = step.segment<2>(contrast_index + 1).norm();
      const double longest = std::max({moved, std::abs(step[contrast_index + 3]), 1e-12});
      share = std::min(share, 0.35 * starts[k].radius_px / longest);
      move = std::max(move, moved);
    }
    p += float(share) * step.cast<float>();
    for (std::size_t k = 0; k < starts.size(); ++k) {
      const Index contrast_index = Model::contrast_of(k);
      const double ratio = double(p[contrast_index + 3]) / starts[k].radius_px;
      const Eigen::Vector2d centre = p.segment<2>(contrast_index + 1).cast<double>();
      if (!(ratio > 0.5 && ratio < 1.8) || (centre - windows[k].centre).norm() > windows[k].radius)
        return std::nullopt;
    }
  }
  if (move > 0.05) return std::nullopt;

  const Normal covariance = covariance_of(model, *patch, sums, cut, options.noise);
  double squares = 0;
  for (Index i = 0; i < patch->count; ++i) {
    const double residual = double(model.residual[static_cast<std::size_t>(i)]);
    squares += residual * residual;
  }
  std::vector<Dot> dots;
  for (std::size_t k = 0; k < starts.size(); ++k) {
    const Index contrast_index = Model::contrast_of(k);
    const double contrast = double(p[contrast_index]);
    if (!(std::abs(contrast) > least_contrast)) return std::nullopt;
    Dot dot;
    dot.centre_px = Eigen::Vector2d(u, v) + p.segment<2>(contrast_index + 1).cast<double>();
    dot.radius_px = double(p[contrast_index + 3]);
    dot.sigma_px = std::sqrt(0.5 * (covariance(contrast_index + 1, contrast_index + 1) +
                                    covariance(contrast_index + 2, contrast_index + 2)));
    dot.contrast = contrast * double(patch->scale);
    dot.misfit = std::sqrt(squares / double(patch->count)) / std::abs(contrast);
    if (!dot.centre_px.allFinite() || !std::isfinite(dot.sigma_px)) return std::nullopt;
    dots.push_back(dot);
  }
  return dots;
}

}  // namespace helicarm
