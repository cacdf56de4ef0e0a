// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include "helicarm/phantom_calibration/bundle.h"

namespace helicarm::phantom_calibration {

/// A pose as Ceres holds it: rotation (row major), then translation.
inline constexpr int pose_size = 12;
/// Focal length (mean of |fx| and fy, px), |fx| / fy, u0, v0.
inline constexpr int intrinsics_size = 4;

void write_pose(const geometry::RigidTransform& pose, double* to);
geometry::RigidTransform read_pose(const double* from);
void write_intrinsics(const geometry::Intrinsics& intrinsics, double* to);
geometry::Intrinsics read_intrinsics(const double* from, bool mirrored);

/// (exp(w) R, t + dt): the parameters of `ViewCovariance`.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return pose_size; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

/// Images of one view, whitened together: blocks are the pose, the intrinsics, and each image's centre.
class ImageCost final : public ceres::CostFunction {
 public:
  /// `whitening` (n x n) times the residuals in u, then those in v.
  ImageCost(std::vector<Eigen::Vector2d> images, Eigen::MatrixXd whitening, bool mirrored);
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override;

 private:
  std::vector<Eigen::Vector2d> images_;
  Eigen::MatrixXd whitening_;
  bool mirrored_;
};

}  // namespace helicarm::phantom_calibration
