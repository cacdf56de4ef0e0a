// SPDX-License-Identifier: Apache-2.0
#include "helicarm/phantom_calibration/image_cost.h"

#include <utility>

#include "helicarm/geometry/rotation.h"

namespace helicarm::phantom_calibration {
namespace {

using RowMatrix3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

/// A point's image and its derivatives by the parameters of `ImageCost`.
struct Projected {
  Eigen::Vector2d uv;
  Eigen::Matrix<double, 2, pose_size> by_pose;
  Eigen::Matrix<double, 2, intrinsics_size> by_intrinsics;
  Eigen::Matrix<double, 2, 3> by_centre;
};

/// Nothing where the point is not in front of the source.
bool project(const geometry::RigidTransform& pose, const double* intrinsics, bool mirrored,
             const Eigen::Vector3d& centre, Projected& to) {
  const geometry::Intrinsics k = read_intrinsics(intrinsics, mirrored);
  const Eigen::Vector3d p = pose * centre;
  if (!(p.z() > 0)) return false;
  const double x = p.x() / p.z(), y = p.y() / p.z();
  to.uv = {k.fx * x + k.u0, k.fy * y + k.v0};
  Eigen::Matrix<double, 2, 3> by_camera;
  by_camera << k.fx / p.z(), 0, -k.fx * x / p.z(), 0, k.fy / p.z(), -k.fy * y / p.z();
  to.by_centre = by_camera * pose.rotation;
  for (Eigen::Index i = 0; i < 3; ++i)
    to.by_pose.middleCols<3>(3 * i) = by_camera.col(i) * centre.transpose();
  to.by_pose.rightCols<3>() = by_camera;
  const double focal = intrinsics[0], aspect = intrinsics[1];
  to.by_intrinsics << k.fx / focal * x, k.fx / (aspect * (1 + aspect)) * x, 1, 0,  //
      k.fy / focal * y, -k.fy / (1 + aspect) * y, 0, 1;
  return true;
}

}  // namespace

void write_pose(const geometry::RigidTransform& pose, double* to) {
  Eigen::Map<RowMatrix3> rotation(to);
  rotation = pose.rotation;
  Eigen::Map<Eigen::Vector3d> translation(to + 9);
  translation = pose.translation;
}

geometry::RigidTransform read_pose(const double* from) {
  return {Eigen::Map<const RowMatrix3>(from), Eigen::Map<const Eigen::Vector3d>(from + 9)};
}

void write_intrinsics(const geometry::Intrinsics& intrinsics, double* to) {
  const double fx = std::abs(intrinsics.fx);
  to[0] = (fx + intrinsics.fy) / 2;
  to[1] = fx / intrinsics.fy;
  to[2] = intrinsics.u0;
  to[3] = intrinsics.v0;
}

geometry::Intrinsics read_intrinsics(const double* from, bool mirrored) {
  const double fy = 2 * from[0] / (1 + from[1]);
  return {(mirrored ? -1 : 1) * from[1] * fy, fy, from[2], from[3], 0};
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  geometry::RigidTransform pose = read_pose(x);
  const Eigen::Map<const Eigen::Vector3d> turn(delta), shift(delta + 3);
  pose.rotation = geometry::nearest_rotation(geometry::rotation_from_vector(turn) * pose.rotation);
  pose.translation += shift;
  write_pose(pose, x_plus_delta);
  return true;
}

bool PoseManifold::PlusJacobian(const double* x, double* jacobian) const {
  Eigen::Map<Eigen::Matrix<double, pose_size, 6, Eigen::RowMajor>> by_delta(jacobian);
  by_delta.setZero();
  const geometry::RigidTransform pose = read_pose(x);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const RowMatrix3 turned = geometry::cross_matrix(Eigen::Vector3d::Unit(axis)) * pose.rotation;
    by_delta.col(axis).head<9>() = Eigen::Map<const Eigen::Vector<double, 9>>(turned.data());
  }
  by_delta.bottomRightCorner<3, 3>().setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const geometry::RigidTransform a = read_pose(y), b = read_pose(x);
  Eigen::Map<Eigen::Vector3d> turn(y_minus_x), shift(y_minus_x + 3);
  turn = geometry::vector_from_rotation(a.rotation * b.rotation.transpose());
  shift = a.translation - b.translation;
  return true;
}

bool PoseManifold::MinusJacobian(const double* x, double* jacobian) const {
  // The columns of PlusJacobian are orthogonal: 2 for the rotation, 1 for the translation.
  Eigen::Matrix<double, pose_size, 6, Eigen::RowMajor> plus;
  PlusJacobian(x, plus.data());
  plus.leftCols<3>() /= 2;
  Eigen::Map<Eigen::Matrix<double, 6, pose_size, Eigen::RowMajor>> by_ambient(jacobian);
  by_ambient = plus.transpose();
  return true;
}

ImageCost::ImageCost(std::vector<Eigen::Vector2d> images, Eigen::MatrixXd whitening, bool mirrored)
    : images_(std::move(images)), whitening_(std::move(whitening)), mirrored_(mirrored) {
  mutable_parameter_block_sizes()->assign(2 + images_.size(), 3);
  (*mutable_parameter_block_sizes())[0] = pose_size;
  (*mutable_parameter_block_sizes())[1] = intrinsics_size;
  set_num_residuals(2 * int(images_.size()));
}

bool ImageCost::Evaluate(const double* const* parameters, double* residuals, double** jacobians) const {
  const auto n = Eigen::Index(images_.size());
  const geometry::RigidTransform pose = read_pose(parameters[0]);
  std::vector<Projected> projected(images_.size());
  Eigen::MatrixX2d difference(n, 2);
  for (Eigen::Index i = 0; i < n; ++i) {
    const std::size_t image = std::size_t(i);
    const Eigen::Map<const Eigen::Vector3d> centre(parameters[2 + image]);
    if (!project(pose, parameters[1], mirrored_, centre, projected[image])) return false;
    difference.row(i) = (projected[image].uv - images_[image]).transpose();
  }
  Eigen::Map<Eigen::MatrixX2d>(residuals, n, 2) = whitening_ * difference;
  if (!jacobians) return true;
  // Rows: u of each image, then v.
  const auto fill = [&](double* to, Eigen::Index columns, auto of_image) {
    Eigen::MatrixXd rows(2 * n, columns);
    for (Eigen::Index i = 0; i < n; ++i) {
      rows.row(i) = of_image(projected[std::size_t(i)]).row(0);
      rows.row(n + i) = of_image(projected[std::size_t(i)]).row(1);
    }
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    Eigen::Map<RowMajor> jacobian(to, 2 * n, columns);
    jacobian.topRows(n) = whitening_ * rows.topRows(n);
    jacobian.bottomRows(n) = whitening_ * rows.bottomRows(n);
  };
  if (jacobians[0]) fill(jacobians[0], pose_size, [](const Projected& p) { return p.by_pose; });
  if (jacobians[1]) fill(jacobians[1], intrinsics_size, [](const Projected& p) { return p.by_intrinsics; });
  for (Eigen::Index i = 0; i < n; ++i) {
    double* to = jacobians[2 + std::size_t(i)];
    if (!to) continue;
    using RowMajor3 = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;
    Eigen::Map<RowMajor3> jacobian(to, 2 * n, 3);
    const auto& by_centre = projected[std::size_t(i)].by_centre;
    jacobian.topRows(n) = whitening_.col(i) * by_centre.row(0);
    jacobian.bottomRows(n) = whitening_.col(i) * by_centre.row(1);
  }
  return true;
}

}  // namespace helicarm::phantom_calibration
