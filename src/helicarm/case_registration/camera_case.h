// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::case_registration {

/// A case that brings cameras of other programs as a measurement: its images, these cameras
/// (`calibration_of_cameras`, those of `earlier` if there is one) and the points of its picks with their
/// tunnels, in the cameras' world. The errors of such cameras are not known, so that those of the points are
/// not either: their covariances are NaN, and each has the warning covariance_missing. Fails as
/// `calibration_of_cameras` and `observe_points`; a refused tunnel is in `Result::failure`.
Expected<pipeline::Result> measure_with_cameras(const std::optional<pipeline::Result>& earlier,
                                                const pipeline::Case& the_case,
                                                const pipeline::RunOptions& options);

}  // namespace helicarm::case_registration
