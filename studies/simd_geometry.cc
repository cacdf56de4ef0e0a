// SPDX-License-Identifier: Apache-2.0
#include "studies/simd_geometry.h"

#include <stdexcept>

namespace helicarm::study {
namespace {

// Powers of two near the spread of a knee phantom and of its image, so that the columns of Eq. 7 have similar
// norms.
constexpr double world_scale_mm = 32;
constexpr double pixel_scale_px = 256;

/// A row of the projection at the scaled balls: y . ball + one.
struct Row {
  SimdPoint y;
  Simd one;

  Simd at(const SimdPoint& ball) const { return dot(y, ball) + one; }
  void add(const SimdPoint& ball, Simd weight) {
    y.x += weight * ball.x;
    y.y += weight * ball.y;
    y.z += weight * ball.z;
    one += weight;
  }
  Row operator+(const Row& o) const { return {{y.x + o.y.x, y.y + o.y.y, y.z + o.y.z}, one + o.one}; }
  void operator+=(const Row& o) { *this = *this + o; }
};

/// Sums of Eq. 7's normal matrix with one pixel coordinate: sum c y y' and sum c y over the balls y.
struct Weighted {
  SimdSymmetric second;
  SimdPoint first{};

  void add(const SimdPoint& ball, Simd weight) {
    const SimdPoint weighted{weight * ball.x, weight * ball.y, weight * ball.z};
    second.add(ball, weighted);
    first.x += weighted.x;
    first.y += weighted.y;
    first.z += weighted.z;
  }
  /// The 4x4 matrix [second, first; first', 0] times a row.
  Row times(const Row& row) const {
    const SimdPoint s = second * row.y;
    return {{s.x + row.one * first.x, s.y + row.one * first.y, s.z + row.one * first.z}, dot(first, row.y)};
  }
};

/// Schur complement of the third row's 4x4 matrix [inner, border; border', corner] after elimination of the
/// first two rows.
struct Reduced {
  SimdSymmetric inner;
  SimdPoint border;
  Simd corner;

  void subtract(const Weighted& view, const SimdSymmetric& inverse, double one_over_n) {
    const SimdSymmetric& s = view.second;
    const SimdPoint& f = view.first;
    const SimdPoint c0 = inverse * SimdPoint{s.xx, s.xy, s.xz};
    const SimdPoint c1 = inverse * SimdPoint{s.xy, s.yy, s.yz};
    const SimdPoint c2 = inverse * SimdPoint{s.xz, s.yz, s.zz};
    const SimdPoint cf = inverse * f;
    inner.xx -= s.xx * c0.x + s.xy * c0.y + s.xz * c0.z + one_over_n * f.x * f.x;
    inner.xy -= s.xy * c0.x + s.yy * c0.y + s.yz * c0.z + one_over_n * f.x * f.y;
    inner.xz -= s.xz * c0.x + s.yz * c0.y + s.zz * c0.z + one_over_n * f.x * f.z;
    inner.yy -= s.xy * c1.x + s.yy * c1.y + s.yz * c1.z + one_over_n * f.y * f.y;
    inner.yz -= s.xz * c1.x + s.yz * c1.y + s.zz * c1.z + one_over_n * f.y * f.z;
    inner.zz -= s.xz * c2.x + s.yz * c2.y + s.zz * c2.z + one_over_n * f.z * f.z;
    border = border - s * cf;
    corner -= dot(f, cf);
  }

  /// For rows y whose last element is y . d.
  SimdSymmetric within(const SimdPoint& d) const {
    SimdSymmetric left = inner;
    left.add(d, {border.x + corner * d.x, border.y + corner * d.y, border.z + corner * d.z});
    left.add(border, d);
    return left;
  }
};

/// Projection of mm to px from its rows at the scaled balls, whose mean is `d`.
SimdProjection unscaled(const Row& of_u, const Row& of_v, const Row& of_w, const SimdPixel& mean_px,
                        const SimdPoint& d) {
  SimdProjection projection;
  projection.w[0] = of_w.y.x / world_scale_mm;
  projection.w[1] = of_w.y.y / world_scale_mm;
  projection.w[2] = of_w.y.z / world_scale_mm;
  const auto put = [&](const Row& row, Simd mean, Simd(&out)[4]) {
    constexpr double scale = pixel_scale_px / world_scale_mm;
    out[0] = scale * row.y.x + mean * projection.w[0];
    out[1] = scale * row.y.y + mean * projection.w[1];
    out[2] = scale * row.y.z + mean * projection.w[2];
    out[3] = pixel_scale_px * (row.one - dot(row.y, d)) + mean;
  };
  put(of_u, mean_px.u, projection.u);
  put(of_v, mean_px.v, projection.v);
  return projection;
}

}  // namespace

SimdBalls::SimdBalls(std::span<const SimdPoint> balls) : count_(balls.size()), centre_{} {
  if (count_ == 0 || count_ > most) throw std::invalid_argument("SimdBalls: 1 to 64 balls");
  const double share = 1 / double(count_);
  for (const SimdPoint& ball : balls) {
    centre_.x += share * ball.x;
    centre_.y += share * ball.y;
    centre_.z += share * ball.z;
  }
  SimdSymmetric moments;
  for (std::size_t i = 0; i < count_; ++i) {
    const SimdPoint out = balls[i] - centre_;
    scaled_[i] = {out.x / world_scale_mm, out.y / world_scale_mm, out.z / world_scale_mm};
    moments.add(scaled_[i], scaled_[i]);
  }
  inverse_ = moments.careful_inverse();
}

SimdProjection SimdBalls::calibrate(std::span<const SimdPixel> pixels) const {
  const double share = 1 / double(count_);
  SimdPixel mean{};
  for (std::size_t i = 0; i < count_; ++i) {
    mean.u += share * pixels[i].u;
    mean.v += share * pixels[i].v;
  }
  const auto cleared = [&](const Row& row) { return Row{inverse_ * row.y, share * row.one}; };
  SimdPixel at[most];  // scaled, about the mean
  for (std::size_t i = 0; i < count_; ++i)
    at[i] = {(pixels[i].u - mean.u) / pixel_scale_px, (pixels[i].v - mean.v) / pixel_scale_px};
  // Sum by sum: the registers hold the terms of only one.
  Weighted by_u, by_v, by_both;
  Simd corner{};
  for (std::size_t i = 0; i < count_; ++i) by_u.add(scaled_[i], at[i].u);
  for (std::size_t i = 0; i < count_; ++i) by_v.add(scaled_[i], at[i].v);
  for (std::size_t i = 0; i < count_; ++i) {
    const Simd weight = at[i].u * at[i].u + at[i].v * at[i].v;
    by_both.add(scaled_[i], weight);
    corner += weight;
  }
  Reduced reduced{by_both.second, by_both.first, corner};
  // Gradient of the first step from the row (0, 1), where the residuals are the pixels.
  Row g_u{by_u.first, {}}, g_v{by_v.first, {}}, g_w{reduced.border, reduced.corner};
  reduced.subtract(by_u, inverse_, share);
  reduced.subtract(by_v, inverse_, share);

  // The third row at the scaled balls is b.y + h with h = 1 + b.d, so that it is 1 at the world's origin.
  const SimdPoint d{centre_.x / world_scale_mm, centre_.y / world_scale_mm, centre_.z / world_scale_mm};
  const SimdSymmetric inner = reduced.within(d).careful_inverse();
  Row of_u{}, of_v{}, of_w{{}, simd(1)};
  // The second iteration recovers the precision lost in the normal equations: residuals are recomputed.
  for (int round = 0; round < 2; ++round) {
    if (round > 0) {
      g_u = g_v = g_w = Row{};
      for (std::size_t i = 0; i < count_; ++i) {
        const SimdPoint& y = scaled_[i];
        const Simd w = of_w.at(y);
        const Simd r_u = at[i].u * w - of_u.at(y), r_v = at[i].v * w - of_v.at(y);
        g_u.add(y, r_u);
        g_v.add(y, r_v);
        g_w.add(y, at[i].u * r_u + at[i].v * r_v);
      }
    }
    const Row s_u = by_u.times(cleared(g_u)), s_v = by_v.times(cleared(g_v));
    const Simd h = s_u.one + s_v.one - g_w.one;
    const SimdPoint b =
        inner * SimdPoint{s_u.y.x + s_v.y.x - g_w.y.x + h * d.x, s_u.y.y + s_v.y.y - g_w.y.y + h * d.y,
                          s_u.y.z + s_v.y.z - g_w.y.z + h * d.z};
    const Row step{b, dot(b, d)};
    of_u += cleared(g_u + by_u.times(step));
    of_v += cleared(g_v + by_v.times(step));
    of_w += step;
  }

  return unscaled(of_u, of_v, of_w, mean, d);
}

}  // namespace helicarm::study
