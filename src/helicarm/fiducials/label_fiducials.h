// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/detection/image_dots.h"
#include "helicarm/fiducials/fiducial.h"
#include "helicarm/fiducials/hypothesis.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm::fiducials {

/// The calibrator's fiducials in one image.
struct LabelledFiducials {
  std::vector<Fiducial> fiducials;          ///< one per ball of the calibrator, in its order
  std::vector<detection::Dot> false_blobs;  ///< candidates of a fiducial's size without a label
  geometry::View view;                      ///< from the labelling: the calibration's start
  bool mirrored = false;
  double margin = 0;          ///< log odds over the best other labelling
  int runner_up_matched = 0;  ///< fiducials of the best other labelling; 0: none
  double runner_up_rms_px = 0;
  double radius_bias = 0;  ///< of the fiducials' radii in the image, relative
  /// Tolerance of the fiducials' coordinates per axis, assumed beyond the file's because labelling fails
  /// without it.
  double assumed_tolerance_mm = 0;
  std::vector<Warning> warnings;
};

/// Possible radii of a fiducial's image for a pixel size on the detector: the fiducial is between the
/// detector and about half way to the source.
Range ball_radii_px(const phantom::Calibrator& calibrator, double pixel_mm);

/// Whether a dot fitted at a predicted position is that fiducial: within `reach_px`, radius within 12 %, and
/// the other fiducials' polarity with at least a quarter of their contrast.
bool is_plausible(const detection::Dot& fitted, const detection::Dot& predicted, double typical_contrast,
                  double reach_px = 4);

struct FiducialOptions {
  rectification::Method method = rectification::Method::best;
  /// Relative bias of all radii in the image, from another view of the calibrator. Along a helix's axis only
  /// the radii distinguish some labellings.
  std::optional<double> radius_bias = {};
  std::optional<bool> mirrored = {};  ///< if known, only this handedness is tried
  /// From other images: labels that only the camera's position distinguishes are then known.
  std::optional<ExpectedView> expected = {};
};

/// 2.3.4: labels the fiducials among the image's dots that are not the plate's (`ball_candidates`), refits
/// them, fits those without a candidate at their predicted positions, and gives each of the others the status
/// that says why it is not used. Refuses as `label_balls`.
Expected<LabelledFiducials> label_fiducials(const xray::XrayImage& xray_image,
                                            const detection::ImageDots& dots,
                                            const rectification::Rectification& rectification,
                                            const phantom::Calibrator& calibrator,
                                            const FiducialOptions& options);

/// A fiducial of a labelling that was refused.
struct GuessedLabel {
  std::string label;
  Eigen::Vector2d uv_raw, uv;  ///< raw and rectified pixels of the candidate
  double residual_px;          ///< from the fiducial's projection, rectified
};

/// The labels that explain the image best although they are refused: to be shown, never to be used. Empty if
/// no pose explains four candidates. Costs as much as `label_fiducials`.
std::vector<GuessedLabel> guess_labels(const xray::XrayImage& xray_image, const detection::ImageDots& dots,
                                       const rectification::Rectification& rectification,
                                       const phantom::Calibrator& calibrator, const FiducialOptions& options);

}  // namespace helicarm::fiducials
