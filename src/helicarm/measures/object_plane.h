// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/calibration/calibrated_view.h"

namespace helicarm::measures {

/// The plane parallel to the detector in which lengths of an image are measured, mm. What lies nearer to the
/// source by 1 mm appears larger by 1 / depth_mm.
struct ObjectPlane {
  geometry::Intrinsics intrinsics;
  double depth_mm;            ///< distance from the source along the central ray
  double relative_sigma = 0;  ///< of lengths, by the calibration and the depth

  /// mm in the plane; the axes are those of the pixels.
  Eigen::Vector2d place_of(const Eigen::Vector2d& rectified) const;
  /// d place / d pixel.
  Eigen::Matrix2d scale() const;
};

/// The plane at a distance from the source, which the view's calibration does not affect.
ObjectPlane plane_at(const calibration::CalibratedView& view, double depth_mm, double depth_sigma_mm);

/// The plane through a point of the calibrator's frame in front of the source, with its covariance (mm^2).
/// The errors of view and point are taken as independent, those of the view's depth and focal length are not.
/// Refuses `behind_source`.
Expected<ObjectPlane> plane_through(const calibration::CalibratedView& view, const Eigen::Vector3d& point,
                                    const Eigen::Matrix3d& covariance = Eigen::Matrix3d::Zero());

}  // namespace helicarm::measures
