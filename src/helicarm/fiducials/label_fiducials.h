// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "helicarm/core/json.h"
#include "helicarm/detection/dot.h"
#include "helicarm/fiducials/fiducial.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm {

/// What stage 2 says of one picture.
struct FoundFiducials {
  std::vector<Fiducial> fiducials;  ///< one per ball of the calibrator, in its order
  std::vector<Dot> false_blobs;     ///< of a ball's size, but no ball of the calibrator
  View view;                        ///< pose estimate from the labelling: a start for the calibration
  bool mirrored = false;
  double margin = 0;          ///< log odds of the labelling against the best other one
  int runner_up_matched = 0;  ///< balls that the best other one names; 0: there is none
  double runner_up_rms_px = 0;
  double radius_bias = 0;  ///< of the balls' radii in the picture, relative
  std::vector<Warning> warnings;
};

/// Radii that a ball's image can have on a receiver of a given pixel: the ball stands somewhere between the
/// receiver and half way to the source.
Range ball_radii_px(const Calibrator& calibrator, double pixel_mm);

/// Whether what was fitted where a pose puts a ball is believed to be it: near the place, of the size, the
/// polarity and a quarter of the contrast at least that the other balls have.
bool is_believable(const Dot& fitted, const Dot& predicted, double typical_contrast);

/// Finds and names the calibrator's balls among the dots that are not the plate's, rescues those that the
/// search missed at their predicted places, and says of each of the others why it is not used. Along the
/// cone's axis the labels hang on the balls' sizes: `radius_bias`, as another view of the same calibrator
/// found it, tells them apart.
Expected<FoundFiducials> find_fiducials(const Exposure& exposure, const Rectification& rectification,
                                        const Calibrator& calibrator, Method method,
                                        std::optional<double> radius_bias = {});

}  // namespace helicarm
