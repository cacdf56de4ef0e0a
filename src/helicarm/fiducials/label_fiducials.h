// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/detection/dot.h"
#include "helicarm/fiducials/candidates.h"
#include "helicarm/fiducials/fiducial.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm {

/// The calibrator's fiducials in one image.
struct LabelledFiducials {
  std::vector<Fiducial> fiducials;  ///< one per ball of the calibrator, in its order
  std::vector<Dot> false_blobs;     ///< candidates of a ball's size that are no ball of the calibrator
  View view;                        ///< estimate from the labelling: a start for the calibration
  bool mirrored = false;
  double margin = 0;          ///< log odds of the labelling against the best other one
  int runner_up_matched = 0;  ///< balls that the best other one names; 0: there is none
  double runner_up_rms_px = 0;
  double radius_bias = 0;  ///< of the balls' radii in the image, relative
  /// Per axis, that was assumed of the balls' places beyond what the file states, because the labels cannot
  /// be found without.
  double assumed_tolerance_mm = 0;
  std::vector<Warning> warnings;
};

/// Radii that a ball's image can have on a receiver of a given pixel: the ball stands somewhere between the
/// receiver and half way to the source.
Range ball_radii_px(const Calibrator& calibrator, double pixel_mm);

/// Whether what was fitted where a pose puts a ball is believed to be it: near the place, of the size, the
/// polarity and a quarter of the contrast at least that the other balls have.
bool is_plausible(const Dot& fitted, const Dot& predicted, double typical_contrast, double reach_px = 4);

struct FiducialOptions {
  Method method = Method::best;
  /// Of all radii in the image, relative, as another view of the same calibrator has it: decides the labels
  /// in a view along a helix's axis, where they follow from the balls' sizes alone.
  std::optional<double> radius_bias = {};
  std::optional<bool> mirrored =
      {};  ///< where the C-arm's handedness is known, only labellings of it are tried
};

/// Stage 3 (2.3.4): labels the calibrator's balls among the candidates, fits again those that the search
/// missed at their predicted places, and gives for each of the others the reason why it is not used. Refuses
/// as `label_balls`.
Expected<LabelledFiducials> label_fiducials(const XrayImage& xray_image, const Rectification& rectification,
                                            const Candidates& candidates, const Calibrator& calibrator,
                                            const FiducialOptions& options);

}  // namespace helicarm
