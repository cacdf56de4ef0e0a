// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "studies/simd.h"

namespace helicarm::study {

struct SimdPoint {
  Simd x, y, z;  ///< mm
};

struct SimdPixel {
  Simd u, v;
};

/// Projection matrix in the frame of the balls, last element 1 (Eq. 6).
struct SimdProjection {
  Simd u[4];
  Simd v[4];
  Simd w[3];
};

inline SimdPoint operator-(const SimdPoint& a, const SimdPoint& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Simd dot(const SimdPoint& a, const SimdPoint& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
[[gnu::always_inline]] inline Simd norm(const SimdPoint& a) { return square_root(dot(a, a)); }

/// A symmetric 3x3 matrix.
struct SimdSymmetric {
  Simd xx{}, xy{}, xz{}, yy{}, yz{}, zz{};

  void add(const SimdPoint& a, const SimdPoint& weighted) {
    xx += a.x * weighted.x;
    xy += a.x * weighted.y;
    xz += a.x * weighted.z;
    yy += a.y * weighted.y;
    yz += a.y * weighted.z;
    zz += a.z * weighted.z;
  }
  SimdPoint operator*(const SimdPoint& a) const {
    return {xx * a.x + xy * a.y + xz * a.z, xy * a.x + yy * a.y + yz * a.z, xz * a.x + yz * a.y + zz * a.z};
  }
  /// The x with this matrix times x = `right`, by Cramer's rule.
  [[gnu::always_inline]] SimdPoint solve(const SimdPoint& right) const {
    const SimdSymmetric adjugate{yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy,
                                 xx * zz - xz * xz, xy * xz - xx * yz, xx * yy - xy * xy};
    const Simd scale = 1.0 / (xx * adjugate.xx + xy * adjugate.xy + xz * adjugate.xz);
    const SimdPoint x = adjugate * right;
    return {x.x * scale, x.y * scale, x.z * scale};
  }
  /// For a positive definite matrix that may be nearly singular, by L D L' factors.
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

/// The part of Eq. 7 that depends only on the balls, equal for all views and noise.
class SimdBalls {
 public:
  static constexpr std::size_t most = 64;

  explicit SimdBalls(std::span<const SimdPoint> balls);

  /// Eq. 7 by least squares in each lane: the same minimiser as `solve_dlt`, its test reference. Balls and
  /// pixels are centred and scaled first; then the eight elements of the first two rows are eliminated, which
  /// appear in one view axis each and share one 4x4 matrix, and a 3x3 system remains. Lanes whose balls do
  /// not constrain the view give arbitrary values or NaN.
  SimdProjection calibrate(std::span<const SimdPixel> pixels) const;

 private:
  std::size_t count_;
  SimdPoint centre_;        // mm
  SimdPoint scaled_[most];  // about the centre
  SimdSymmetric inverse_;   // of the balls' second moments
};

/// Eq. 8 (right side corrected) for two views by least squares, weighted as in `intersect_linear`.
[[gnu::always_inline]] inline SimdPoint intersect(const SimdProjection& a, const SimdPixel& in_a,
                                                  const SimdProjection& b, const SimdPixel& in_b) {
  SimdSymmetric normal;
  SimdPoint right{};
  const auto add = [&](const SimdProjection& view, const Simd(&row)[4], Simd pixel) {
    const SimdPoint left{pixel * view.w[0] - row[0], pixel * view.w[1] - row[1], pixel * view.w[2] - row[2]};
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
inline Simd ray_distance(const SimdProjection& view, const SimdPixel& pixel, const SimdPoint& point) {
  const auto plane = [&](const Simd(&row)[4], Simd at) {
    return SimdPoint{at * view.w[0] - row[0], at * view.w[1] - row[1], at * view.w[2] - row[2]};
  };
  const SimdPoint u = plane(view.u, pixel.u), v = plane(view.v, pixel.v);
  const Simd off_u = dot(u, point) - (view.u[3] - pixel.u), off_v = dot(v, point) - (view.v[3] - pixel.v);
  const Simd uu = dot(u, u), uv = dot(u, v), vv = dot(v, v);
  return square_root((vv * off_u * off_u - 2.0 * uv * off_u * off_v + uu * off_v * off_v) /
                     (uu * vv - uv * uv));
}

}  // namespace helicarm::study
