// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "helicarm/study/simd.h"

namespace helicarm {

struct LanePoint {
  Simd x, y, z;  ///< mm
};

struct LanePixel {
  Simd u, v;
};

/// Projections in the world of the balls, with 1 as the last element (Eq. 6).
struct LaneProjection {
  Simd u[4];
  Simd v[4];
  Simd w[3];
};

inline LanePoint operator-(const LanePoint& a, const LanePoint& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Simd dot(const LanePoint& a, const LanePoint& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
[[gnu::always_inline]] inline Simd norm(const LanePoint& a) { return square_root(dot(a, a)); }

/// A symmetric 3x3 matrix.
struct SimdSymmetric {
  Simd xx{}, xy{}, xz{}, yy{}, yz{}, zz{};

  void add(const LanePoint& a, const LanePoint& weighted) {
    xx += a.x * weighted.x;
    xy += a.x * weighted.y;
    xz += a.x * weighted.z;
    yy += a.y * weighted.y;
    yz += a.y * weighted.z;
    zz += a.z * weighted.z;
  }
  LanePoint operator*(const LanePoint& a) const {
    return {xx * a.x + xy * a.y + xz * a.z, xy * a.x + yy * a.y + yz * a.z, xz * a.x + yz * a.y + zz * a.z};
  }
  /// The x of which this matrix times x is `right`, by Cramer's rule.
  [[gnu::always_inline]] LanePoint solve(const LanePoint& right) const {
    const SimdSymmetric adjugate{yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy,
                                 xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy};
    const Simd scale = 1.0 / (xx * adjugate.xx + xy * adjugate.xy + xz * adjugate.xz);
    const LanePoint x = adjugate * right;
    return {x.x * scale, x.y * scale, x.z * scale};
  }
  /// Of a positive definite matrix that may be near singular, by its triangular factors (L D L').
  SimdSymmetric careful_inverse() const {
    const Simd a = 1.0 / xx;
    const Simd l1 = xy * a, l2 = xz * a;
    const Simd rest = yz - l2 * xy;
    const Simd b = 1.0 / (yy - l1 * xy);
    const Simd l3 = rest * b;
    const Simd c = 1.0 / (zz - l2 * xz - l3 * rest);
    const Simd m = l1 * l3 - l2;
    return {a + l1 * l1 * b + m * m * c, -l1 * b - m * l3 * c, m * c, b + l3 * l3 * c, -l3 * c, c};
  }
};

/// What Eq. 7 needs to know of the balls, the same for every view and every noise.
class LaneBalls {
 public:
  static constexpr std::size_t most = 64;

  explicit LaneBalls(std::span<const LanePoint> balls);

  /// Eq. 7 by least squares, for each lane on its own: the same minimiser as `solve_dlt`, which is its
  /// oracle. The balls' mean and the pixels' mean are moved to 0 and both are scaled first; then the eight
  /// numbers of the first two rows are eliminated, for they appear in one view axis each and share one 4x4
  /// matrix. What is left is 3x3. Simd whose balls leave the view open give nonsense or NaN.
  LaneProjection calibrate(std::span<const LanePixel> pixels) const;

 private:
  std::size_t count_;
  LanePoint centre_;        // mm
  LanePoint scaled_[most];  // about the centre
  SimdSymmetric inverse_;   // of the balls' second moments
};

/// Eq. 8 (its right side corrected) for two views by least squares, weighted as `intersect_linear` does.
[[gnu::always_inline]] inline LanePoint intersect(const LaneProjection& a, const LanePixel& in_a,
                                                  const LaneProjection& b, const LanePixel& in_b) {
  SimdSymmetric normal;
  LanePoint right{};
  const auto add = [&](const LaneProjection& view, const Simd(&row)[4], Simd pixel) {
    const LanePoint left{pixel * view.w[0] - row[0], pixel * view.w[1] - row[1], pixel * view.w[2] - row[2]};
    const Simd value = row[3] - pixel;
    normal.add(left, left);
    right.x += left.x * value;
    right.y += left.y * value;
    right.z += left.z * value;
  };
  add(a, a.u, in_a.u);
  add(a, a.v, in_a.v);
  add(b, b.u, in_b.u);
  add(b, b.v, in_b.v);
  return normal.solve(right);
}

/// Distance of a point from the ray through a pixel.
inline Simd ray_distance(const LaneProjection& view, const LanePixel& pixel, const LanePoint& point) {
  const auto plane = [&](const Simd(&row)[4], Simd at) {
    return LanePoint{at * view.w[0] - row[0], at * view.w[1] - row[1], at * view.w[2] - row[2]};
  };
  const LanePoint u = plane(view.u, pixel.u), v = plane(view.v, pixel.v);
  const Simd off_u = dot(u, point) - (view.u[3] - pixel.u), off_v = dot(v, point) - (view.v[3] - pixel.v);
  const Simd uu = dot(u, u), uv = dot(u, v), vv = dot(v, v);
  return square_root((vv * off_u * off_u - 2.0 * uv * off_u * off_v + uu * off_v * off_v) /
                     (uu * vv - uv * uv));
}

}  // namespace helicarm
