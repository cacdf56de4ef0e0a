// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/pipeline/stages.h"

namespace helicarm::pipeline {

/// The failure of a refusal. If its view would be accepted with another pixel size or source distance
/// (`plate_mismatch`, `plate_not_found`, `calibrator_mismatch`, `ambiguous_labels`, `too_few_fiducials`), the
/// message states it and the figures are extended by `file_pixel_mm`, `fitting_pixel_mm`,
/// `file_source_detector_mm`, `fitting_source_detector_mm`, or by `fitting_diameters`, how many times as
/// large as in the file the balls are. If it would be accepted with its columns resampled, the failure is
/// `unequal_pixels` with the figure `aspect`. Costs about twenty-five labellings.
Failure with_cause(const Refusal& refusal, const Case& the_case, const RunOptions& options);

}  // namespace helicarm::pipeline
