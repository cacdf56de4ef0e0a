// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/detection/dot.h"
#include "helicarm/fiducials/fiducial.h"
#include "helicarm/geometry/view.h"
#include "helicarm/phantom/calibrator.h"
#include "helicarm/rectification/rectify.h"

namespace helicarm {

/// What stage 2 says of one picture.
struct FoundFiducials {
  std::vector<Fiducial> fiducials;    ///< one per ball of the calibrator, in its order
  std::vector<Dot> false_blobs;       ///< of a ball's size, but no ball of the calibrator
  View view;                          ///< pose estimate from the labelling: a start for the calibration
  bool mirrored = false;
  double ambiguity = 0;               ///< runner-up's rms over the winner's
  std::vector<Warning> warnings;
};

/// Finds and names the calibrator's balls among the dots that are not the plate's, rescues those that the search
/// missed at their predicted places, and says of each of the others why it is not used.
Expected<FoundFiducials> find_fiducials(const Exposure& exposure, const Rectification& rectification,
                                        const Calibrator& calibrator, Method method);

}  // namespace helicarm
