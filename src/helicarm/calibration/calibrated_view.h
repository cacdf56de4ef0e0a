// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/fiducials/fiducial.h"
#include "helicarm/geometry/dlt.h"
#include "helicarm/geometry/view.h"

namespace helicarm::calibration {

/// Parameters of a view: fx, fy, u0, v0, rotation vector in the camera frame (rad), translation (mm), skew.
inline constexpr int view_parameters = 11;
using ViewCovariance = Eigen::Matrix<double, view_parameters, view_parameters>;

/// A calibrated view.
struct CalibratedView {
  std::string name;
  geometry::View view;                      ///< world = calibrator, pixels = rectified
  std::optional<geometry::DltFactors> dlt;  ///< A1..A11 of Eq. 6; nothing where t_z = 0
  /// Of the view's parameters; the true pose is (exp(w) R, t + dt). Zero: not computed.
  ViewCovariance covariance = ViewCovariance::Zero();
  double reprojection_rms_px = 0;
  double chi2 = 0;        ///< of the residuals from the fiducials' estimated positions
  int dof = 0;            ///< expected chi2: observations less the share of the joint fit that they determine
  double condition = 0;   ///< of the normalised DLT's design matrix
  bool by_paper = false;  ///< by Eq. 7 alone (`--method paper`); points of such views are those of Eq. 8
};

/// Of the source in the calibrator's frame, mm^2. Zero: not computed.
Eigen::Matrix3d source_covariance(const CalibratedView& view);

/// Views calibrated together.
struct Calibration {
  std::vector<CalibratedView> views;
  /// Of all views' parameters (CalibratedView::covariance), 11 n x 11 n. Empty: not computed.
  Eigen::MatrixXd joint_covariance = {};
  std::vector<std::vector<fiducials::Fiducial>> fiducials =
      {};                     ///< per view, with residuals; outliers are `rejected`
  double chi2 = 0;            ///< of all views together
  int dof = 0;                ///< 0: chi2 is not known
  double variance_scale = 1;  ///< covariance inflation where chi2 contradicts the fiducials' sigmas
};

}  // namespace helicarm::calibration
