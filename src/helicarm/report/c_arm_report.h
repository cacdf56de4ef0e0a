// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "helicarm/report/c_arm_findings.h"
#include "helicarm/report/table.h"

namespace helicarm::report {

/// A row per acquisition: position, date, focal length and principal point, difference from the prediction.
Table c_arm_table(std::span<const calibration::AcquisitionCheck> acquisitions);

/// A row per acquisition with a distortion map: position, date, how far the map is off the prediction by all
/// others, and off one map for all.
Table c_arm_map_table(std::span<const LeftOutMap> maps);

/// A page with the C-arm's variation, its curves over the primary angle, and each acquisition beside the
/// prediction by all others. It names no image and no person.
std::string c_arm_report_html(const CArmFindings& findings);

/// The same as PDF, with lines for date and signature.
std::string c_arm_report_pdf(const CArmFindings& findings);

/// Removes the files of an earlier report from `folder`.
void forget_c_arm_report(const std::filesystem::path& folder);

/// Writes report.html, report.pdf, c_arm.csv, c_arm.svg and, of distortion maps and runs, c_arm_maps.csv and
/// c_arm_runs.csv into `folder`, without files of an earlier report.
Expected<void> write_c_arm_report(const CArmFindings& findings, const std::filesystem::path& folder);

}  // namespace helicarm::report
