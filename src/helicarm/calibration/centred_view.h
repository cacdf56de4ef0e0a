// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "helicarm/calibration/calibrated_view.h"
#include "helicarm/geometry/view.h"

namespace helicarm::calibration {

/// A view parametrised about the centre of its fiducials: with d = R (x - centre),
///   gx = (dx - qx dz) / (1 + dz rho),   gy = (dy - qy dz) / (1 + dz rho),
///   u = uc + ax gx + skew gy,   v = vc + ay gy.
/// Focal length and distance are strongly correlated in (fx, u0, t). Here rho (inverse depth of the centre)
/// carries that uncertainty alone, and the fit is nearly linear.
struct CentredView {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();        ///< in the world, mm
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< camera_from_world
  double ax = 0, ay = 0;                                   ///< magnification, px / mm
  double uc = 0, vc = 0;                                   ///< image of the centre, px
  double rho = 0;                                          ///< 1 / mm
  double qx = 0, qy = 0;  ///< tangent of the centre's angle off the central ray
  double skew = 0;        ///< px / mm
};

/// Step of (ax, ay, uc, vc, rotation vector in the camera frame, rho, qx, qy, skew).
using ViewStep = Eigen::Vector<double, view_parameters>;

CentredView centred(const geometry::View& view, const Eigen::Vector3d& centre);
geometry::View uncentred(const CentredView& view);
CentredView moved(const CentredView& view, const ViewStep& step);

struct ImageCoordinates {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, view_parameters> by_step;
  Eigen::Matrix<double, 2, 3> by_point;
  double relative_depth;  ///< over that of the centre; positive in front of the source
};
ImageCoordinates image_of(const CentredView& view, const Eigen::Vector3d& point_in_world);

/// d (the parameters of `CalibratedView::covariance`) / d step.
ViewCovariance parameters_by_step(const CentredView& view);

/// d pixel / d (the parameters of `CalibratedView::covariance`) of a plain view.
Eigen::Matrix<double, 2, view_parameters> pixel_by_parameters(const geometry::View& view,
                                                              const Eigen::Vector3d& point_in_world);

}  // namespace helicarm::calibration
