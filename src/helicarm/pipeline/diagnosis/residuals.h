// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/calibration/calibrate.h"
#include "helicarm/pipeline/stages.h"

namespace helicarm::pipeline {

/// A change of the images that explains the fiducials' residuals.
struct ImageChange {
  enum class Kind { radial, scale, aspect } kind;
  std::optional<std::size_t> view;  ///< nothing: all views
  double amount = 0;                ///< radial: share at half the image's width; scale, aspect: factor - 1
  double sigma = 0;
  double chi2_before = 0;
  double chi2_after = 0;
  int dof = 0;  ///< after
};

/// The one-parameter change that lowers chi2 most, by at least 25 (five standard deviations), to within three
/// standard deviations of its degrees of freedom. Nothing if the fiducials fit without, or no change explains
/// them. `size_px`: of each image (width, height).
std::optional<ImageChange> best_image_change(const std::vector<calibration::ViewFiducials>& views,
                                             const std::vector<Eigen::Vector2d>& size_px,
                                             const calibration::CommonPrior& common);

/// Warnings `residual_distortion` (radial distortion, aspect) and `intrinsics_inconsistent` (magnification of
/// one view, or of all by a wrong source distance) if the residuals imply them.
std::vector<Warning> explain_residuals(const std::vector<LabelledView>& views,
                                       const calibration::CalibrationResult& calibration,
                                       const calibration::CommonPrior& common);

/// Warnings about the intrinsics of a calibration whose residuals are small, because the intrinsics absorb
/// what is wrong: `check_intrinsics`, `check_distortion`, and `residual_distortion` for a round field, as of
/// an image intensifier, that neither plate nor map rectifies, unless the fiducials exclude a distortion (a
/// round collimator).
std::vector<Warning> doubtful_intrinsics(const std::vector<LabelledView>& views,
                                         const calibration::CalibrationResult& calibration,
                                         const calibration::CommonPrior& common);

}  // namespace helicarm::pipeline
