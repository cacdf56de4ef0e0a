// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/core/failure.h"
#include "helicarm/geometry/rigid_transform.h"

namespace helicarm {

/// The image of a point in one of the calibrated views.
struct PointObservation {
  std::size_t view;                            ///< index into the calibration
  Eigen::Vector2d uv;                          ///< rectified px
  Eigen::Matrix2d covariance_px2;              ///< zero: exact
  RigidTransform calibrator_from_anchor = {};  ///< at the moment of this image; see LocatedPoint
  /// What a wrong `calibrator_from_anchor` does to the point's place in the calibrator, mm^2. It counts in
  /// whether the rays meet; in the point's own covariance it is left to `guide`.
  Eigen::Matrix3d anchor_covariance = Eigen::Matrix3d::Zero();
};

enum class PointSource { pick, target };

/// A point found in space. Its anchor is the frame in which it rests between the images: the calibrator, or
/// a bone that moves.
struct LocatedPoint {
  std::string name;
  PointSource source = PointSource::pick;
  Eigen::Vector3d point_in_anchor;       ///< mm
  Eigen::Matrix3d covariance_in_anchor;  ///< mm^2, of pixels and calibration
  Eigen::Matrix3Xd by_calibration = {};  ///< d point / d the views' parameters, which all points share
  double ray_gap_mm = 0;
  double chi2 = 0;  ///< 2n - 3 degrees of freedom
  std::vector<std::string> views = {};
  std::optional<Warning> missing_rays = {};  ///< residual_too_large: the covariance has been inflated

  double predicted_rms_mm() const;
};

/// Least reprojection error over n >= 2 views, each pixel weighted by its own noise and by the calibration's.
/// A calibration without a covariance enters the point's covariance by the views' reprojection errors.
/// `motion_sigma_mm` (per axis): motion of the point between the first view's acquisition and each later one.
/// Rays that miss each other by over three standard deviations show that one of them is not of this point:
/// the covariance is inflated until they meet. The 95 % length is never below half the ray gap. Refuses as
/// `intersect`.
Expected<LocatedPoint> locate(const std::string& name, PointSource source,
                              std::span<const PointObservation> observations, const Calibration& calibration,
                              double motion_sigma_mm = 0);

/// A note: motion between the acquisitions along the first view's ray moves the located point by as much and
/// leaves no ray gap. The direction is a unit vector in the calibrator's frame.
Warning unobservable_motion(const std::string& name, const Eigen::Vector3d& point_in_calibrator,
                            const CalibratedView& first, double motion_sigma_mm);

/// Covariance (mm^2) of a point that would be seen in all views with a given noise per axis: the predicted
/// TRE is the root of its trace. Refuses as `locate`, `behind_source` where a view cannot see it.
Expected<Eigen::Matrix3d> predict_covariance(const Eigen::Vector3d& point_in_calibrator, double sigma_px,
                                             const Calibration& calibration, double motion_sigma_mm = 0);

}  // namespace helicarm
