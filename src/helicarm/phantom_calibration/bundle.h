// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "helicarm/calibration/priors.h"
#include "helicarm/core/failure.h"
#include "helicarm/geometry/view.h"

namespace helicarm::phantom_calibration {

/// The image of a fiducial's centre in one view.
struct FiducialImage {
  std::size_t fiducial;  ///< the same in all views
  Eigen::Vector2d uv;    ///< rectified px
  double sigma_px;       ///< per axis, without the distortion map's error
};

struct BundleView {
  std::string name;
  geometry::View start;  ///< world: that of `BundleProblem::centres`; fx < 0 where the image is mirrored
  geometry::IntrinsicsPrior prior;
  std::vector<FiducialImage> images;
  /// Of the distortion map among the images, per axis (n x n, px^2). Empty: the map is exact.
  Eigen::MatrixXd map_covariance_px2 = {};
};

/// Views of one rigid phantom, taken by one C-arm.
struct BundleProblem {
  std::vector<Eigen::Vector3d> centres;  ///< start, mm; each is seen in two views or more
  std::vector<BundleView> views;
  calibration::CArmPrior c_arm;
};

struct BundleOptions {
  bool robust = false;  ///< Cauchy loss on each image, map errors taken as independent
  bool fixed_centres = false;
  std::optional<std::size_t> free_centre = {};  ///< the one of the fixed centres that is free all the same
  int most_iterations = 300;
};

struct BundleFit {
  std::vector<Eigen::Vector3d> centres;
  std::vector<geometry::View> views;
  std::vector<std::vector<Eigen::Vector2d>> residuals_px;  ///< projection less image, per view and image
  /// Fall of chi2 without an image: by chance it follows chi2 with 2 degrees of freedom.
  std::vector<std::vector<double>> falls;
  double chi2 = 0;
  int dof = 0;
  double rms_px = 0;  ///< per axis, over all images
  /// Of all centres (3n x 3n, mm^2), the sigmas taken as they are. Position, orientation and scale are not
  /// observable: those seven are fixed by inner constraints, which leave the trace least. With fixed centres
  /// that of the free one (3 x 3), if any. Empty with robust loss.
  Eigen::MatrixXd covariance_mm2;
};

/// Bundle adjustment: centres, a pose for each view, and intrinsics that vary about values shared by the
/// C-arm (`CArmPrior`). Maximum likelihood. `uncertain` where the images do not determine the problem.
Expected<BundleFit> adjust(const BundleProblem& problem, const BundleOptions& options = {});

}  // namespace helicarm::phantom_calibration
