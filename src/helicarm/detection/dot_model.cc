// SPDX-License-Identifier: Apache-2.0
#include "helicarm/detection/dot_model.h"

#include <algorithm>
#include <cmath>

namespace helicarm::detection {

using Eigen::Index;

DotModel::DotModel(std::span<const BallProfile> profiles_of, const DotPatch& patch) : profiles(profiles_of) {
  const std::size_t n = patch.x.size();
  const auto pairs = static_cast<Index>(dots() * (dots() - 1) / 2);
  rows.resize(contrast_of(dots()) + pairs + 1, static_cast<Index>(n));
  open_.resize(n);
  scratch_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    const float x = patch.x[i] * patch.inverse_window;
    const float y = patch.y[i] * patch.inverse_window;
    const auto column = static_cast<Index>(i);
    rows(0, column) = 1;
    rows(3, column) = x * x;
    rows(4, column) = x * y;
    rows(5, column) = y * y;
  }
}

namespace {

// Loops that GCC 12 must vectorise are separate functions: inlining would lose `__restrict`.

/// One dot's profile (negative) and its derivatives, before scaling by contrast.
[[gnu::noinline]] void draw_dot(std::size_t n, const float* __restrict xs, const float* __restrict ys,
                                BallProfile::Table profile, const float* of_dot, float* __restrict covered,
                                float* __restrict by_u, float* __restrict by_v, float* __restrict by_radius) {
  const float u = of_dot[1];
  const float v = of_dot[2];
  const float per_radius = 1 / of_dot[3];
  for (std::size_t i = 0; i < n; ++i) {
    const float dx = xs[i] - u;
    const float dy = ys[i] - v;
    const float distance = std::sqrt(dx * dx + dy * dy + 1e-8f);
    const auto sample = profile.at(distance * per_radius);
    const float steep = -sample.slope * per_radius;
    const float steep_per_px = steep / distance;
    covered[i] = -sample.value;
    by_u[i] = steep_per_px * dx;
    by_v[i] = steep_per_px * dy;
    by_radius[i] = steep * distance * per_radius;
  }
}

/// Subtracts the background, of which dots hide a share, from the grey values.
[[gnu::noinline]] void take_background(std::size_t n, const float* __restrict xs, const float* __restrict ys,
                                       const float* __restrict grey, const float* __restrict open,
                                       float per_window, const DotModel::Parameters& p,
                                       float* __restrict by_bx, float* __restrict by_by,
                                       float* __restrict by_hidden, float* __restrict left) {
  const float level = p[0];
  const float slope_x = p[1];
  const float slope_y = p[2];
  const float bend_xx = p[3];
  const float bend_xy = p[4];
  const float bend_yy = p[5];
  const float hides = p[DotModel::hidden];
  for (std::size_t i = 0; i < n; ++i) {
    const float x = xs[i] * per_window;
    const float y = ys[i] * per_window;
    const float slant = slope_x * x + slope_y * y;
    const float shut = 1 - open[i];
    const float seen = 1 - hides * shut;
    by_bx[i] = x * seen;
    by_by[i] = y * seen;
    by_hidden[i] = -slant * shut;
    left[i] = grey[i] - (level + slant * seen + bend_xx * x * x + bend_xy * x * y + bend_yy * y * y);
  }
}

[[gnu::noinline]] void drop_clipped(std::size_t n, const char* __restrict clipped, float* __restrict left) {
  for (std::size_t i = 0; i < n; ++i) left[i] = clipped[i] ? std::max(0.0f, left[i]) : left[i];
}

}  // namespace

void DotModel::evaluate(const DotPatch& patch, const Parameters& p) {
  const std::size_t n = patch.x.size();
  const auto row = [&](Index k) { return rows.row(k).data(); };
  const float* xs = patch.x.data();
  const float* ys = patch.y.data();
  using Array = Eigen::Map<Eigen::ArrayXf>;
  const auto array = [&](float* data) { return Array(data, static_cast<Index>(n)); };
  float* residuals = row(parameters());
  Array left = array(residuals);
  Array open = array(open_.data());
  Array change = array(scratch_.data());  // change of the model per unit profile of one dot
  open = 1;
  for (std::size_t k = 0; k < dots(); ++k) {
    const Index at = contrast_of(k);
    draw_dot(n, xs, ys, profiles[k].table(), &p[at], row(at), row(at + 1), row(at + 2), row(at + 3));
    open *= 1 + array(row(at));
  }
  take_background(n, xs, ys, patch.grey.data(), open_.data(), patch.inverse_window, p, row(1), row(2),
                  row(hidden), residuals);
  for (std::size_t j = 0; j < dots(); ++j)
    for (std::size_t i = 0; i < j; ++i) {
      Array common = array(row(overlap_of(i, j)));
      common = array(row(contrast_of(i))) * array(row(contrast_of(j)));
      left -= p[overlap_of(i, j)] * common;
    }
  const float hides_per_px = p[hidden] * patch.inverse_window;
  const Eigen::Map<const Eigen::ArrayXf> x(xs, static_cast<Index>(n));
  const Eigen::Map<const Eigen::ArrayXf> y(ys, static_cast<Index>(n));
  for (std::size_t k = 0; k < dots(); ++k) {
    const Index at = contrast_of(k);
    left -= p[at] * array(row(at));
    open = hides_per_px * (p[1] * x + p[2] * y);
    change = -p[at];
    for (std::size_t other = 0; other < dots(); ++other) {
      if (other == k) continue;
      const Array beside = array(row(contrast_of(other)));
      change -= p[overlap_of(std::min(k, other), std::max(k, other))] * beside;
      open *= 1 + beside;
    }
    change -= open;
    for (const Index i : {1, 2, 3}) array(row(at + i)) *= change;
  }
  drop_clipped(n, patch.clipped.data(), residuals);
}

DotSums accumulate(const DotModel& model, const DotPatch& patch) {
  const Eigen::MatrixXd products = weighted_products(model.rows, patch.weight);
  const Index n = model.parameters();
  return {products.topLeftCorner(n, n), products.col(n).head(n), products(n, n)};
}

}  // namespace helicarm::detection
