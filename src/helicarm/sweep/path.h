// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/calibration/priors.h"
#include "helicarm/sweep/smooth_path.h"

namespace helicarm::sweep {

/// How the pixels of a run lie on its detector.
struct Detector {
  Eigen::Vector2i image_size{0, 0};
  double pixel_mm = 1;  ///< height of a pixel; where it is not known, a scale that makes lengths plausible
  double aspect = 1;    ///< fx / fy: negative for mirrored images

  Eigen::Vector2d centre_px() const { return (image_size - Eigen::Vector2i::Ones()).cast<double>() / 2; }
};

/// Source, centre of the image on the detector (mm, calibrator frame) and orientation of a camera.
struct PlacedCamera {
  Eigen::Vector3d source, detector;
  Eigen::Matrix3d rotation;  ///< camera_from_world
};
PlacedCamera placed(const geometry::View& view, const Detector& detector);
geometry::View view_of(const PlacedCamera& camera, const Detector& detector);

/// The reference that the path deviates from: a camera that turns about an axis; or one that rests.
struct Orbit {
  std::optional<Eigen::Vector3d> axis;  ///< unit vector; nothing: the camera does not turn
  Eigen::Vector3d centre;               ///< on the axis, mm
  PlacedCamera first;                   ///< at the angle 0

  PlacedCamera at(double angle_deg) const;
};

/// The orbit of these cameras, and each one's angle: of its source about the centre, unwrapped in the order
/// given; the first's is 0. Without a turn the angle is that of the source in its mean plane about `centre`;
/// with one, the axis passes where the cameras' turn shows it, and `centre` is a start.
struct OrbitFit {
  Orbit orbit;
  std::vector<double> angles_deg;
};
OrbitFit fit_orbit(const std::vector<PlacedCamera>& cameras, const Eigen::Vector3d& centre);

CameraVector deviation_of(const PlacedCamera& camera, const PlacedCamera& reference);
PlacedCamera deviated(const PlacedCamera& reference, const CameraVector& deviation);

/// d (the parameters of `CalibratedView::covariance`) / d deviation.
Eigen::Matrix<double, calibration::view_parameters, camera_size> parameters_by_deviation(
    const PlacedCamera& camera, const PlacedCamera& reference, const Detector& detector);

/// One frame's input of the joint estimate.
struct FramePoints {
  std::vector<Eigen::Vector3d> points;  ///< mm, calibrator frame
  std::vector<Eigen::Vector2d> pixels;  ///< rectified
  std::vector<std::size_t> balls;       ///< index of each in the calibrator
  Eigen::VectorXd image_variance_px2;   ///< of each pixel along each axis, as the detection states it
  Eigen::VectorXd ball_variance_px2;    ///< by the ball's own error, as if it were independent
  Eigen::MatrixXd map_covariance_px2;   ///< n x n, the same along each axis
  Eigen::MatrixXd whitening;            ///< L^-1 of the pixels' covariance
};

/// The frame's information on its camera, linearised there.
PathObservation observation_of(const FramePoints& frame, const PlacedCamera& at, double angle_deg,
                               const Orbit& orbit, const Detector& detector);

/// Of each pixel, the share of its variance that a camera with this covariance, fitted to it, leaves in the
/// residual.
std::vector<double> free_shares(const FramePoints& frame, const PlacedCamera& at,
                                const CameraMatrix& covariance, const PlacedCamera& reference,
                                const Detector& detector);

/// Change of the frame's value by errors of its pixels: of each pixel, a row of unit errors along u, and the
/// same along v.
Eigen::MatrixXd value_by_pixels(const FramePoints& frame, const PlacedCamera& at,
                                const PathObservation& observation, const PlacedCamera& reference,
                                const Detector& detector, const Eigen::MatrixXd& roots);

/// Change of the frame's value by independent unit errors of the phantom (`roots`: of each ball, mm).
Eigen::MatrixXd value_by_phantom(const FramePoints& frame, const PlacedCamera& at,
                                 const PathObservation& observation, const PlacedCamera& reference,
                                 const Detector& detector, const std::vector<Eigen::Matrix3Xd>& roots);

}  // namespace helicarm::sweep
