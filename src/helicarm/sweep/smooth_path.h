// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

namespace helicarm::sweep {

/// Deviation of a camera from the reference orbit, in the axes of the reference camera: source (mm), centre
/// of the image on the detector (mm), rotation vector (rad).
inline constexpr int camera_size = 9;
using CameraVector = Eigen::Matrix<double, camera_size, 1>;
using CameraMatrix = Eigen::Matrix<double, camera_size, camera_size>;

/// What one frame says of its camera.
struct PathObservation {
  double angle_deg = 0;      ///< along the path, ascending
  CameraVector value;        ///< the camera's deviation by this frame alone
  CameraMatrix information;  ///< inverse of its covariance
  CameraVector turn;         ///< effect of a turn about the axis, which is free: zero if none is
  Eigen::Matrix<double, camera_size, 6> motion;  ///< effect of a rigid motion of the phantom
};

/// Standard deviations of the model, for source, detector and rotation: of the path's bending (an integrated
/// random walk of the angle) per degree^1.5, and of each frame about the path.
struct Stiffness {
  Eigen::Vector3d bend;    ///< mm, mm, rad
  Eigen::Vector3d jitter;  ///< mm, mm, rad
};

struct PathPoint {
  CameraVector path, camera;  ///< the path there, and this frame's own place about it
  CameraMatrix path_covariance, camera_covariance;
  double off_path_chi2 =
      0;  ///< of the frame from the path of the others, 8 degrees of freedom (9 without turn)
};

struct SmoothPath {
  Stiffness stiffness;
  double log_likelihood = 0;
  std::vector<PathPoint> points;
};

/// Prior of the path's middle, such as nominal distances: information and its product with the value.
struct PathPrior {
  CameraMatrix information = CameraMatrix::Zero();
  CameraVector gradient = CameraVector::Zero();
};

/// The path of maximum marginal likelihood: a cubic smoothing spline of source, detector and rotation over
/// the angle, with jitter of each frame, stiffness and jitter chosen by the data. Time linear in the frames.
/// `start`: of a search that is nearly done.
Stiffness choose_stiffness(const std::vector<PathObservation>& frames, const PathPrior& prior,
                           const std::optional<Stiffness>& start = {});
SmoothPath smooth_path(const std::vector<PathObservation>& frames, const PathPrior& prior,
                       const Stiffness& stiffness);

/// Change of each frame's camera by a change of the frames' values, of which the columns are several.
std::vector<Eigen::MatrixXd> response(const std::vector<PathObservation>& frames, const PathPrior& prior,
                                      const Stiffness& stiffness, const std::vector<Eigen::MatrixXd>& values);

/// A rigid motion of the phantom between two frames.
struct PhantomStep {
  std::size_t first = 0;               ///< in the order of time
  Eigen::Matrix<double, 6, 1> motion;  ///< rotation (rad), translation (mm)
  double chi2 = 0;  ///< twice the gain of the logarithm of the likelihood, 6 degrees of freedom
};

/// The step that explains the frames best; stiffness and jitter are chosen anew with it, as a step makes the
/// path seem softer. `stiffness`: of the frames without a step; `order`: the frames' indices in the order of
/// time.
std::optional<PhantomStep> find_step(const std::vector<PathObservation>& frames, const PathPrior& prior,
                                     const Stiffness& stiffness, const std::vector<std::size_t>& order);

}  // namespace helicarm::sweep
