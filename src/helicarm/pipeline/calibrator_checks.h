// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "helicarm/pipeline/calibrate_case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm {

/// What the images say of the calibrator's scale, apart from its coordinates.
struct ScaleEvidence {
  double excess = 0;  ///< the file's coordinates over the true ones, less 1
  double sigma = 0;   ///< of that; 0: nothing is known
};

/// From the balls' diameters as seen, which the file states, and Distance Source to Patient (0018,1111).
ScaleEvidence scale_evidence(const CalibrationResult& calibration, const std::vector<LabelledView>& images,
                             const Calibrator& calibrator);

/// Whether the calibrator's file can be the calibrator in the images. Refuses `ambiguous_labels` where the
/// labels leave a third of the balls and as many candidates unexplained, `ambiguous_handedness` where every
/// image looks mirrored and nothing says so, `scale_disagrees` where the scale is off by ten sigma,
/// `calibrator_mismatch` where labels were found only with an assumed tolerance and the views disagree about
/// the balls' offsets. Adds warnings: the scale off by three sigma, balls seen off their places.
Expected<CaseCalibration> check_calibrator(CaseCalibration calibration,
                                           const std::vector<LabelledView>& images, const Case& given);

/// What an error of the calibrator's scale does, which no image shows: the millimetres per per cent at each
/// point, and the distances from the source for a tape measure. Empty where the file states its scale's
/// sigma.
std::vector<Warning> scale_notes(const Case& given, const CaseCalibration& calibration,
                                 const std::vector<PointResult>& points);

}  // namespace helicarm
