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
#include "helicarm/phantom/calibrator.h"

namespace helicarm::localization {

/// The observation of a point in one of the calibrated views.
struct PointObservation {
  std::size_t view;                                      ///< index into the calibration
  Eigen::Vector2d uv;                                    ///< rectified px
  Eigen::Matrix2d covariance_px2;                        ///< zero: exact
  geometry::RigidTransform calibrator_from_anchor = {};  ///< at the acquisition; see LocatedPoint
  /// Covariance of the point in the calibrator due to `calibrator_from_anchor`, mm^2. Enters chi2 only;
  /// `guide` adds it to the point's covariance.
  Eigen::Matrix3d anchor_covariance = Eigen::Matrix3d::Zero();
};

/// A person's mark, or a ball or wire that the program finds.
enum class PointSource { pick, target };
inline constexpr std::array<std::string_view, 2> source_words{"pick", "target"};
constexpr std::string_view word(PointSource source) { return source_words[std::size_t(source)]; }

/// A located point. Its anchor is the frame in which it is at rest between the acquisitions: the calibrator
/// or a bone.
struct LocatedPoint {
  std::string name;
  PointSource source = PointSource::pick;
  Eigen::Vector3d point_in_anchor;       ///< mm
  Eigen::Matrix3d covariance_in_anchor;  ///< mm^2, of pixels and calibration
  Eigen::Matrix3Xd by_calibration = {};  ///< d point / d views' parameters, common to all points
  double ray_gap_mm = 0;
  double chi2 = 0;  ///< 2n - 3 degrees of freedom
  std::vector<std::string> views = {};
  std::optional<Warning> missing_rays = {};  ///< residual_too_large: the covariance has been inflated

  double predicted_rms_mm() const;
};

/// Triangulates from n >= 2 views by least weighted reprojection error; the weights include the observations'
/// and the calibration's covariance, or the views' reprojection errors if it has none. Views `by_paper` give
/// the point of Eq. 8, with the covariance of the weighted one.
/// `motion_sigma_mm` (per axis): motion of the point between the first view's acquisition and each later one.
/// If chi2 exceeds three standard deviations (9 per degree of freedom for two views), the covariance is
/// inflated by it and `missing_rays` is set. The 95 % length is at least half the gap of two rays; of n rays
/// at least their rms distance from the point times the square root of 2 / n. Refuses as `intersect`.
Expected<LocatedPoint> locate(const std::string& name, PointSource source,
                              std::span<const PointObservation> observations,
                              const calibration::Calibration& calibration, double motion_sigma_mm = 0);

/// covariance_missing: the calibration of one of the point's views has no covariance, so that the point has
/// none; half of `ray_gap_mm` bounds its error from below where it has two views.
std::optional<Warning> covariance_missing(const LocatedPoint& point,
                                          std::span<const PointObservation> observations,
                                          const calibration::Calibration& calibration);

/// A note: motion between the acquisitions along the first view's ray displaces the located point by the same
/// amount without a ray gap. The direction is a unit vector in the calibrator's frame.
Warning unobservable_motion(const std::string& name, const Eigen::Vector3d& point_in_calibrator,
                            const calibration::CalibratedView& first, double motion_sigma_mm);

/// pick_on_fiducial: the point was picked on the projections of balls in all its views, or in some while its
/// rays miss each other.
std::optional<Warning> pick_on_fiducial(const std::string& name,
                                        std::span<const PointObservation> observations,
                                        const calibration::Calibration& calibration,
                                        std::span<const phantom::CalibratorBall> balls, bool rays_miss);

/// Covariance (mm^2) of a point observed in all views with the given noise per axis; the predicted TRE is the
/// square root of its trace. Refuses as `locate`, and `behind_source`.
Expected<Eigen::Matrix3d> predict_covariance(const Eigen::Vector3d& point_in_calibrator, double sigma_px,
                                             const calibration::Calibration& calibration,
                                             double motion_sigma_mm = 0);

}  // namespace helicarm::localization
