// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "helicarm/geometry/rigid_transform.h"

namespace helicarm::phantom_calibration {

/// Small motions of points (3n x 7): translation along x, y, z, rotation about x, y, z through their mean,
/// and growth about it (the point's offset from the mean).
Eigen::MatrixXd similarity_motions(std::span<const Eigen::Vector3d> points);

/// Inverse of the normal equations of points (3n x 3n) whose null space the columns of `motions` span, under
/// inner constraints: no covariance along those motions. Nothing where more is undetermined.
std::optional<Eigen::MatrixXd> inner_constraint_covariance(const Eigen::MatrixXd& normal,
                                                           const Eigen::MatrixXd& motions);

/// A covariance of points carried into the frame that is fixed by a weighted fit (one weight for each
/// point): the motions are removed so that the weighted points do not move (Baarda 1973, S-transformation).
Eigen::MatrixXd in_frame_of(const Eigen::MatrixXd& covariance, const Eigen::MatrixXd& motions,
                            const Eigen::VectorXd& weights);

struct Similarity {
  double scale = 1;
  geometry::RigidTransform a_from_b;  ///< a = scale * rotation * b + translation

  Eigen::Vector3d operator*(const Eigen::Vector3d& b) const {
    return scale * (a_from_b.rotation * b) + a_from_b.translation;
  }
};

/// The weighted least-squares similarity that maps `from` to `to` (Umeyama 1991); without `scaled` it is
/// rigid.
Similarity similarity_between(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                              const Eigen::VectorXd& weights, bool scaled);

struct RobustFit {
  Similarity a_from_b;
  Eigen::VectorXd weights;  ///< 0 to 1: points far beyond the others' median distance hardly count
};

/// As `similarity_between`, with Tukey weights, so that a displaced point does not move the frame.
RobustFit robust_similarity(std::span<const Eigen::Vector3d> from, std::span<const Eigen::Vector3d> to,
                            bool scaled);

}  // namespace helicarm::phantom_calibration
