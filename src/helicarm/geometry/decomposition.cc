// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/decomposition.h"

#include <cmath>

#include <Eigen/Geometry>

namespace helicarm::geometry {
namespace {

constexpr double least_sine = 1e-9;  // of the angle between a row and the span of the rows below it
constexpr double farthest_source_mm = 1e9;

struct Split {
  double along;
  Eigen::Vector3d across;
};

/// Component along a unit axis and remainder; the second pass removes the rounding error of the first.
Split split(const Eigen::Vector3d& row, const Eigen::Vector3d& axis) {
  const double first = row.dot(axis);
  const Eigen::Vector3d rest = row - first * axis;
  const double second = rest.dot(axis);
  return {first + second, rest - second * axis};
}

tl::unexpected<Failure> source_at_infinity() {
  return fail(Reason::point_at_infinity, "the projection matrix has no finite X-ray source");
}

/// `sign` times the matrix is positive in front of the source.
Expected<View> decompose_signed(const Projection& projection, double sign) {
  if (!projection.allFinite())
    return fail(Reason::not_finite, "the projection matrix contains a number that is not finite");
  const double scale = sign * projection.row(2).head<3>().norm();
  if (scale == 0) return source_at_infinity();
  const Projection p = projection / scale;
  if (!p.allFinite()) return source_at_infinity();
  const Eigen::Vector3d z = p.row(2).head<3>().normalized();
  const Split second = split(p.row(1).head<3>(), z);
  const double fy = second.across.norm();
  if (fy <= least_sine * p.row(1).head<3>().norm()) return source_at_infinity();
  const Eigen::Vector3d y = second.across / fy;
  const Eigen::Vector3d x = y.cross(z);
  const Eigen::Vector3d first = p.row(0).head<3>();
  const Intrinsics k{first.dot(x), fy, first.dot(z), second.along, first.dot(y)};
  if (std::abs(k.fx) <= least_sine * first.norm()) return source_at_infinity();
  View view{k, {}};
  view.camera_from_world.rotation << x.transpose(), y.transpose(), z.transpose();
  const double tz = p(2, 3);
  const double ty = (p(1, 3) - k.v0 * tz) / k.fy;
  view.camera_from_world.translation << (p(0, 3) - k.u0 * tz - k.skew * ty) / k.fx, ty, tz;
  if (!(view.camera_from_world.translation.norm() < farthest_source_mm)) return source_at_infinity();
  return view;
}

}  // namespace

Expected<View> decompose(const Projection& projection) {
  return decompose_signed(projection, projection.leftCols<3>().determinant() < 0 ? -1 : 1);
}

Expected<View> decompose(const Projection& projection, const Eigen::Vector3d& point_in_front) {
  return decompose_signed(projection, projection.row(2).dot(point_in_front.homogeneous()) < 0 ? -1 : 1);
}

}  // namespace helicarm::geometry
