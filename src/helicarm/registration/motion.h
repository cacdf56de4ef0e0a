// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/geometry/view.h"

namespace helicarm::registration {

/// A small affine motion of the model in the world about a centre c: p -> p + t + B (p - c). Rotation, strain
/// and every change of a camera's parameters are such motions, so one derivative serves all.
/// Order: t (mm), then B row by row.
inline constexpr int affine_parameters = 12;
/// After the affine motion comes the outward offset of the model's edges in the image, px.
inline constexpr int edge_offset = affine_parameters;
inline constexpr int parameters = affine_parameters + 1;

using AffineMotion = Eigen::Matrix<double, affine_parameters, 1>;
using Gradient = Eigen::Matrix<double, parameters, 1>;
using Information = Eigen::Matrix<double, parameters, parameters>;

/// A small rigid motion about the centre: rotation vector (rad), then translation (mm), in world axes.
using RigidStep = Eigen::Matrix<double, 6, 1>;
using RigidCovariance = Eigen::Matrix<double, 6, 6>;

/// d affine / d rigid step.
Eigen::Matrix<double, affine_parameters, 6> affine_from_rigid();

/// d affine / d strain: xx, yy, zz, xy, xz, yz of a symmetric B along `axes` (columns, world).
Eigen::Matrix<double, affine_parameters, 6> affine_from_strain(const Eigen::Matrix3d& axes);

/// d affine / d a view's parameters (`calibration::view_parameters`): the motion of the model that moves its
/// image as a change of the camera does. Exact to first order for every point.
Eigen::Matrix<double, affine_parameters, 11> affine_from_camera(const geometry::View& view,
                                                                const Eigen::Vector3d& centre);

/// The covariance of all views' parameters (11 n x 11 n) with a motion of the model between the first view's
/// acquisition and each later one, per axis: by d it is one of the camera by R d, and isotropic noise stays
/// itself when turned.
Eigen::MatrixXd cameras_with_motion(Eigen::MatrixXd camera_covariance, double motion_sigma_mm);

/// The pose after a rigid step about `centre` (world).
geometry::RigidTransform moved_about(const geometry::RigidTransform& pose, const Eigen::Vector3d& centre,
                                     const RigidStep& step);

/// The step from one pose to another about `centre`: `moved_about(from, centre, step)` is `to`.
RigidStep step_about(const geometry::RigidTransform& from, const geometry::RigidTransform& to,
                     const Eigen::Vector3d& centre);

/// Covariance (mm^2) of a point fixed to the model, from the pose's covariance about `centre`.
Eigen::Matrix3d point_covariance(const RigidCovariance& covariance, const Eigen::Vector3d& centre,
                                 const Eigen::Vector3d& point);

}  // namespace helicarm::registration
