// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/absolute_pose.h"
#include "helicarm/geometry/rigid_transform.h"
#include "helicarm/geometry/view.h"
#include "helicarm/registration/motion.h"

namespace helicarm::track {

using registration::RigidCovariance;
using registration::RigidStep;

/// A marker's image in one view, rectified pixels.
struct Sight {
  const geometry::View* view;
  Eigen::Vector2d uv;
  double sigma_px;  ///< per axis
};

/// A marker of a body and where it is seen.
struct SeenMarker {
  Eigen::Vector3d in_body;
  std::vector<Sight> sights;
};

/// What is known of a pose beforehand: mean and covariance about a centre (rotation vector in rad, then mm,
/// in world axes).
struct PosePrior {
  geometry::RigidTransform world_from_body;
  RigidCovariance covariance;
  Eigen::Vector3d centre;
};

struct PoseFit {
  geometry::RigidTransform world_from_body;
  Eigen::Vector3d centre;      ///< world, mm: of the body's markers
  RigidCovariance covariance;  ///< about `centre`; by the images and the prior
  std::vector<double> chi2;    ///< per marker, of its images about the pose
  std::vector<double> weight;  ///< per marker: 0 for one that does not fit
  int determining = 0;         ///< markers with weight
};

struct PoseFitOptions {
  double loose_mm = 0;  ///< how far a marker may be from its place in the body, per axis
  bool robust = false;  ///< markers far from the pose lose their weight; the start must be near
  int iterations = 15;
};

/// The pose of least weighted squares over all markers' images. Nothing where markers and prior do not
/// determine it.
std::optional<PoseFit> fit_pose(const geometry::RigidTransform& start, std::span<const SeenMarker> markers,
                                const std::optional<PosePrior>& prior, const PoseFitOptions& options);

/// Covariance of a fitted pose as that of all the body's markers by least squares: of the images' noise, and
/// of the deviations of markers from their places in the body (`loose_mm` per axis), which a pose of all
/// markers averages and a pose of some does not.
RigidCovariance covariance_of(const PoseFit& fit, std::span<const SeenMarker> markers, double loose_mm);

/// d point / d step (rotation about `centre`, translation), for a point that moves with the body.
Eigen::Matrix<double, 3, 6> point_by_step(const Eigen::Vector3d& point, const Eigen::Vector3d& centre);

/// Standard deviations of the points about their mean along the principal axes, mm, descending. A body's pose
/// is determined by the second: the distance of its markers from their common line.
Eigen::Vector3d extents(std::span<const Eigen::Vector3d> points);

/// Condition number of radiostereometry (Soderkvist and Wedin 1993), per metre: 1 / sqrt(s2^2 + s3^2) of the
/// singular values of the markers about their mean.
double condition_per_m(std::span<const Eigen::Vector3d> points);

}  // namespace helicarm::track
