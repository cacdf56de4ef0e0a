// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/fit_dot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

namespace helicarm {
namespace {

/// Parameters: background b0 bx by bxx bxy byy (patch coordinates in units of the window), contrast, centre,
/// hidden share, radius.
constexpr int n_parameters = 11;
constexpr int n_background = 6;
constexpr double least_contrast = 1e-4;  ///< as a share of the patch's mean: below, rounding errors speak
using Parameters = Eigen::Matrix<float, n_parameters, 1>;
using Normal = Eigen::Matrix<double, n_parameters, n_parameters>;
using Vector = Eigen::Matrix<double, n_parameters, 1>;

struct Pixel {
  float x, y;  ///< from the patch's origin, px
  float grey;
  float weight;
  bool clipped;  ///< the true value is at least `grey`
};

struct Patch {
  std::vector<Pixel> pixels;
  float inverse_window;
  float scale;  ///< grey values are divided by it
};

constexpr int block = 64;

/// A block of pixels: residuals, and derivatives as columns. Written so that the compiler can use wide
/// registers.
struct Block {
  alignas(32) float residual[block];
  alignas(32) float row[n_parameters][block];
};

inline float background_at(const Parameters& p, float x, float y) {
  return p[0] + p[1] * x + p[2] * y + p[3] * x * x + p[4] * x * y + p[5] * y * y;
}

/// Hands over what residual and derivatives at one pixel are made of.
template <class Take>
inline void shade_at(const Patch& patch, const BallProfile& profile, const Parameters& p, const Pixel& pixel,
                     Take&& take) {
  const float x = pixel.x * patch.inverse_window;
  const float y = pixel.y * patch.inverse_window;
  const float dx = pixel.x - p[7];
  const float dy = pixel.y - p[8];
  const float distance = std::sqrt(dx * dx + dy * dy);
  const auto sample = profile.at(distance / p[10]);
  const float slant = p[1] * x + p[2] * y;
  const float height = p[6] + p[9] * slant;
  float residual = pixel.grey - (background_at(p, x, y) - height * sample.value);
  if (pixel.clipped && residual < 0) residual = 0;
  take(x, y, dx, dy, distance, sample, slant, height, residual);
}

void find_residuals(const Patch& patch, const BallProfile& profile, const Parameters& p,
                    std::vector<float>& residuals) {
  for (std::size_t i = 0; i < patch.pixels.size(); ++i)
    shade_at(patch, profile, p, patch.pixels[i],
             [&](float, float, float, float, float, BallProfile::Sample, float, float, float residual) {
               residuals[i] = residual;
             });
}

struct Sums {
  Normal normal = Normal::Zero();
  Vector right = Vector::Zero();
  double squares = 0;
  double weight = 0;
};

void add_block(const Block& rows, int count, const float* weights,
               Eigen::Matrix<float, n_parameters, n_parameters>& normal,
               Eigen::Matrix<float, n_parameters, 1>& right) {
  alignas(32) float weighted[block];
  for (int a = 0; a < n_parameters; ++a) {
    for (int k = 0; k < count; ++k) weighted[k] = weights[k] * rows.row[a][k];
    for (int k = count; k < block; ++k) weighted[k] = 0;
    using Column = Eigen::Map<const Eigen::Matrix<float, block, 1>, Eigen::Aligned32>;
    const Column left(weighted);
    for (int b = a; b < n_parameters; ++b) normal(b, a) += left.dot(Column(rows.row[b]));
    right[a] += left.dot(Column(rows.residual));
  }
}

Sums accumulate(const Patch& patch, const BallProfile& profile, const Parameters& p) {
  Sums sums;
  Eigen::Matrix<float, n_parameters, n_parameters> normal =
      Eigen::Matrix<float, n_parameters, n_parameters>::Zero();
  Eigen::Matrix<float, n_parameters, 1> right = Eigen::Matrix<float, n_parameters, 1>::Zero();
  Block rows{};
  alignas(32) float weights[block];
  int count = 0;
  for (const Pixel& pixel : patch.pixels) {
    if (pixel.weight == 0) continue;
    shade_at(patch, profile, p, pixel,
             [&](float x, float y, float dx, float dy, float distance, BallProfile::Sample sample,
                 float slant, float height, float residual) {
               if (pixel.clipped && residual == 0) return;
               const int k = count++;
               rows.residual[k] = residual;
               rows.row[0][k] = 1;
               rows.row[1][k] = x - p[9] * x * sample.value;
               rows.row[2][k] = y - p[9] * y * sample.value;
               rows.row[3][k] = x * x;
               rows.row[4][k] = x * y;
               rows.row[5][k] = y * y;
               rows.row[6][k] = -sample.value;
               const float steep = -height * sample.slope / p[10];
               const float along = distance > 1e-4f ? steep / distance : 0;
               rows.row[7][k] = -along * dx;
               rows.row[8][k] = -along * dy;
               rows.row[9][k] = -slant * sample.value;
               rows.row[10][k] = -steep * distance / p[10];
               weights[k] = pixel.weight;
               sums.squares += double(pixel.weight * residual * residual);
               sums.weight += double(pixel.weight);
             });
    if (count == block) {
      add_block(rows, count, weights, normal, right);
      count = 0;
    }
  }
  if (count > 0) add_block(rows, count, weights, normal, right);
  sums.normal = normal.cast<double>().selfadjointView<Eigen::Lower>();
  sums.right = right.cast<double>();
  return sums;
}

/// Tukey's weights from the residuals' median absolute deviation, which is taken as `least` at least.
void reweight(Patch& patch, const std::vector<float>& residuals, float least, std::vector<float>& scratch) {
  scratch.resize(residuals.size());
  std::transform(residuals.begin(), residuals.end(), scratch.begin(), [](float r) { return std::abs(r); });
  auto middle = scratch.begin() + static_cast<std::ptrdiff_t>(scratch.size() / 2);
  std::nth_element(scratch.begin(), middle, scratch.end());
  const float sigma = std::max({1.4826f * *middle, least, 1e-6f});
  const float cut = 4.7f * sigma;
  for (std::size_t i = 0; i < residuals.size(); ++i) {
    const float t = residuals[i] / cut;
    patch.pixels[i].weight = std::abs(t) < 1 ? (1 - t * t) * (1 - t * t) : 0;
  }
}

std::optional<Patch> gather(const Image<float>& image, int u, int v, float window,
                            std::span<const Disc> others, const DotFitOptions& options) {
  Patch patch;
  patch.inverse_window = 1 / window;
  const int half = static_cast<int>(std::ceil(window));
  std::vector<Disc> near;
  for (const Disc& disc : others)
    if (std::hypot(disc.centre.x() - u, disc.centre.y() - v) < double(window) + disc.radius)
      near.push_back(disc);
  patch.pixels.reserve(static_cast<std::size_t>((2 * half + 1) * (2 * half + 1)));
  int inside = 0;
  int open = 0;
  double sum = 0;
  for (int y = -half; y <= half; ++y)
    for (int x = -half; x <= half; ++x) {
      if (float(x * x + y * y) > window * window) continue;
      ++inside;
      if (!image.contains(u + x, v + y)) continue;
      const float grey = image(u + x, v + y);
      if (grey <= options.floor) continue;
      const bool hidden = std::any_of(near.begin(), near.end(), [&](const Disc& disc) {
        const double dx = u + x - disc.centre.x();
        const double dy = v + y - disc.centre.y();
        return dx * dx + dy * dy < disc.radius * disc.radius;
      });
      if (hidden) continue;
      const bool clipped = grey >= options.ceiling;
      patch.pixels.push_back({float(x), float(y), grey, 1, clipped});
      open += !clipped;
      sum += double(grey);
    }
  if (open < 30 || double(patch.pixels.size()) < 0.4 * inside) return std::nullopt;
  patch.scale = std::max(1e-3f, float(std::abs(sum)) / float(patch.pixels.size()));
  for (Pixel& pixel : patch.pixels) pixel.grey /= patch.scale;
  return patch;
}

/// Linear start for background and contrast at the given centre and radius.
bool solve_linear(const Patch& patch, const BallProfile& profile, Parameters& p) {
  constexpr int n = n_background + 1;
  Eigen::Matrix<double, n, n> normal = Eigen::Matrix<double, n, n>::Zero();
  Eigen::Matrix<double, n, 1> right = Eigen::Matrix<double, n, 1>::Zero();
  for (const Pixel& pixel : patch.pixels) {
    const double x = double(pixel.x * patch.inverse_window);
    const double y = double(pixel.y * patch.inverse_window);
    const float distance = std::hypot(pixel.x - p[7], pixel.y - p[8]);
    Eigen::Matrix<double, n, 1> row;
    row << 1, x, y, x * x, x * y, y * y, -double(profile.at(distance / p[10]).value);
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
    right += double(pixel.grey) * row;
  }
  const Eigen::Matrix<double, n, 1> solution = normal.selfadjointView<Eigen::Lower>().ldlt().solve(right);
  if (!solution.allFinite()) return false;
  p.head<n>() = solution.cast<float>();
  return true;
}

}  // namespace

std::optional<Dot> fit_dot(const Image<float>& image, const Dot& start, const BallProfile& profile,
                           std::span<const Disc> others, const DotFitOptions& options) {
  const int u = static_cast<int>(std::lround(start.centre_px.x()));
  const int v = static_cast<int>(std::lround(start.centre_px.y()));
  if (!image.contains(u, v) || !(start.radius_px > 0.5)) return std::nullopt;
  const float radius = float(start.radius_px);
  const float window = radius * float(1 + options.margin_share) + float(options.margin_px);
  auto patch = gather(image, u, v, window, others, options);
  if (!patch) return std::nullopt;

  Parameters p;
  p[7] = float(start.centre_px.x() - u);
  p[8] = float(start.centre_px.y() - v);
  p[9] = float(options.hidden_share);
  p[10] = radius;
  if (!solve_linear(*patch, profile, p)) return std::nullopt;

  std::vector<float> residuals(patch->pixels.size());
  std::vector<float> scratch;
  const auto noise = [&](const Sums& s) { return s.squares / std::max(1.0, s.weight - n_parameters); };
  const int free = options.free_radius ? n_parameters : n_parameters - 1;
  Sums sums = accumulate(*patch, profile, p);
  double move = 0;
  for (int i = 0; i < options.iterations; ++i) {
    const Vector step = [&] {
      Vector full = Vector::Zero();
      const double pull = noise(sums) / (options.hidden_sigma * options.hidden_sigma);
      Normal normal = sums.normal;
      Vector right = sums.right;
      normal(9, 9) += pull;
      right[9] += pull * (options.hidden_share - double(p[9]));
      full.head(free) = normal.topLeftCorner(free, free).ldlt().solve(right.head(free));
      return full;
    }();
    if (!step.allFinite()) return std::nullopt;
    move = std::hypot(step[7], step[8]);
    const double limit = 0.35 * double(radius);
    const float share = float(std::min(1.0, limit / std::max({move, std::abs(step[10]), 1e-12})));
    p += share * step.cast<float>();
    if (!(p[10] > 0.5f * radius && p[10] < 1.8f * radius) || std::hypot(p[7], p[8]) > window)
      return std::nullopt;
    find_residuals(*patch, profile, p, residuals);
    // Outliers are told from a rough start only by and by.
    const double tolerance = std::max(options.tolerance, 0.3 * std::pow(0.5, i));
    reweight(*patch, residuals, float(tolerance) * std::abs(p[6]), scratch);
    sums = accumulate(*patch, profile, p);
    if (i >= 4 && move < 2e-3) break;
  }
  if (move > 0.05) return std::nullopt;

  const double variance = noise(sums);
  sums.normal(9, 9) += variance / (options.hidden_sigma * options.hidden_sigma);
  const Normal inverse = [&] {
    Normal full = Normal::Zero();
    full.topLeftCorner(free, free) =
        sums.normal.topLeftCorner(free, free).ldlt().solve(Eigen::MatrixXd::Identity(free, free));
    return full;
  }();
  const double contrast = double(p[6]);
  if (!(std::abs(contrast) > least_contrast)) return std::nullopt;
  Dot dot;
  dot.centre_px = {u + double(p[7]), v + double(p[8])};
  dot.radius_px = double(p[10]);
  dot.sigma_px = std::sqrt(std::max(0.0, variance * 0.5 * (inverse(7, 7) + inverse(8, 8))));
  dot.contrast = contrast * double(patch->scale);
  find_residuals(*patch, profile, p, residuals);
  double raw_squares = 0;
  for (float r : residuals) raw_squares += double(r * r);
  dot.misfit = std::sqrt(raw_squares / double(residuals.size())) / std::max(1e-9, std::abs(contrast));
  return dot.centre_px.allFinite() && std::isfinite(dot.sigma_px) ? std::optional(dot) : std::nullopt;
}

}  // namespace helicarm
