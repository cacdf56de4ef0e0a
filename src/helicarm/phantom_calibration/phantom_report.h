// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "helicarm/phantom_calibration/measure_phantom.h"

namespace helicarm::phantom_calibration {

/// One page: what was measured, residuals of each view, differences from the nominal file as a table and as
/// arrows on the phantom, and what they do to a located point.
std::string phantom_report_html(const PhantomResult& result);

/// calibrator.json (without a failure), report.html and result.json.
Expected<void> write_phantom(const PhantomResult& result, const std::filesystem::path& folder);

/// rms error (mm) that errors of the balls' coordinates cause at a point, as if the phantom were registered
/// by them: Fitzpatrick, West and Maurer 1998, with the given rms error of a ball.
double predicted_tre_mm(const std::vector<Eigen::Vector3d>& balls, double ball_rms_mm,
                        const Eigen::Vector3d& point);

}  // namespace helicarm::phantom_calibration
