// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/core/failure.h"
#include "helicarm/registration/motion.h"

namespace helicarm::registration {

inline constexpr std::size_t least_landmarks = 3;

/// A landmark in the model and in the world.
struct Landmark {
  std::string name;
  Eigen::Vector3d in_model;
  Eigen::Vector3d in_world;
  Eigen::Matrix3d covariance_in_world = Eigen::Matrix3d::Zero();  ///< mm^2, of its own; zero: not known
  Eigen::MatrixXd by_cameras = {};  ///< d in_world / d the parameters of all views, 3 x 11 n; empty: none
};

struct LandmarkRegistration {
  geometry::RigidTransform world_from_model;
  Eigen::Vector3d centre;               ///< mean of the landmarks, world
  std::vector<Eigen::Vector3d> places;  ///< the model's landmarks at the pose, world
  std::vector<double> residuals_mm;     ///< FRE of each
  double fre_mm = 0;                    ///< rms
  double fle_mm = 0;                    ///< rms; from the residuals or from the covariances, the larger
  /// About `centre`: of the picks' own covariances, and of what these leave unexplained of the residuals
  /// (Fitzpatrick, West and Maurer 1998), widened so that 95 % limits are Student's of 3 n - 6 degrees of
  /// freedom; with the errors of the cameras that the landmarks share.
  RigidCovariance covariance;
};

/// Least-squares rigid motion from model to world (Arun 1987, proper rotations only). Refuses (bad_value)
/// fewer than three landmarks, and landmarks near one line. `camera_covariance`: of all views' parameters,
/// 11 n x 11 n; empty: taken as exact.
Expected<LandmarkRegistration> register_landmarks(const std::vector<Landmark>& landmarks,
                                                  const Eigen::MatrixXd& camera_covariance = {});

/// Predicted TRE (rms, mm) at a point of the world.
double predicted_tre_mm(const LandmarkRegistration& registration, const Eigen::Vector3d& point_in_world);

}  // namespace helicarm::registration
