// SPDX-License-Identifier: Apache-2.0
#include "helicarm/geometry/rotation.h"

#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <fmt/format.h>

namespace helicarm::geometry {
namespace {

constexpr double rigid_tolerance = 1e-3;
constexpr double locked_cos_beta = 1e-9;
constexpr double opposite = 1e-9;  // length of the sum of two unit vectors

}  // namespace

Eigen::Matrix3d rotation_from_euler(double alpha, double beta, double gamma) {
  const double ca = std::cos(alpha), sa = std::sin(alpha);
  const double cb = std::cos(beta), sb = std::sin(beta);
  const double cg = std::cos(gamma), sg = std::sin(gamma);
  Eigen::Matrix3d rotation;
  rotation << cb * cg, sa * sb * cg + ca * sg, -ca * sb * cg + sa * sg,  //
      -cb * sg, -sa * sb * sg + ca * cg, ca * sb * sg + sa * cg,         //
      sb, -sa * cb, ca * cb;
  return rotation;
}

EulerAngles euler_from_rotation(const Eigen::Matrix3d& rotation) {
  const double cos_beta = std::hypot(rotation(2, 1), rotation(2, 2));
  EulerAngles angles;
  angles.beta = std::atan2(rotation(2, 0), cos_beta);
  angles.gimbal_locked = cos_beta < locked_cos_beta;
  if (angles.gimbal_locked) {
    angles.alpha = std::atan2(rotation(1, 2), rotation(1, 1));
  } else {
    angles.alpha = std::atan2(-rotation(2, 1), rotation(2, 2));
    angles.gamma = std::atan2(-rotation(1, 0), rotation(0, 0));
  }
  return angles;
}

Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  return (Eigen::Matrix3d() << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0).finished();
}

Eigen::Matrix3d rotation_from_vector(const Eigen::Vector3d& vector) {
  const double half = vector.norm() / 2;
  const double scale = half < 1e-8 ? 0.5 : std::sin(half) / (2 * half);
  Eigen::Quaterniond q;
  q.w() = std::cos(half);
  q.vec() = scale * vector;
  return q.toRotationMatrix();
}

Eigen::Vector3d vector_from_rotation(const Eigen::Matrix3d& rotation) {
  Eigen::Quaterniond q(rotation);
  if (q.w() < 0) q.coeffs() *= -1;
  const double sine = q.vec().norm();
  const double scale = sine < 1e-8 ? 2 : 2 * std::atan2(sine, q.w()) / sine;
  return scale * q.vec();
}

Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  // Half a turn about `from`, then one about the direction between the two.
  const auto half_turn = [](const Eigen::Vector3d& about) -> Eigen::Matrix3d {
    return 2 * about * about.transpose() - Eigen::Matrix3d::Identity();
  };
  const Eigen::Vector3d start = from.normalized(), sum = start + to.normalized();
  if (sum.norm() < opposite) return half_turn(start.unitOrthogonal());
  return half_turn(sum.normalized()) * half_turn(start);
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1);
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

Expected<RigidTransform> rigid_transform_from(const Eigen::Matrix4d& matrix, const std::string& what) {
  if (!matrix.allFinite()) return fail(Reason::not_finite, fmt::format("{}: a number is not finite", what));
  if ((matrix.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() > rigid_tolerance)
    return fail(Reason::bad_value, fmt::format("{}: the last row is not 0 0 0 1", what));
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const double off = (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).norm();
  if (!(off <= rigid_tolerance))
    return fail(
        Reason::bad_value,
        fmt::format("{}: not a rigid motion, |R'R - I| is {:.3g}, limit {:g}", what, off, rigid_tolerance),
        {{"off_orthogonal", off}});
  if (rotation.determinant() < 0)
    return fail(Reason::bad_value, fmt::format("{}: a reflection (determinant -1), not a rotation", what));
  return RigidTransform{nearest_rotation(rotation), matrix.topRightCorner<3, 1>()};
}

}  // namespace helicarm::geometry
