// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <span>

#include "helicarm/calibration/c_arm_maps.h"
#include "helicarm/calibration/c_arm_model.h"
#include "helicarm/core/json.h"
#include "helicarm/report/table.h"

namespace helicarm::report {

/// A row per acquisition: position, date, focal length and principal point, difference from the prediction.
Table c_arm_table(std::span<const calibration::AcquisitionCheck> acquisitions);

/// The same numbers: view, date, primary_deg, secondary_deg, then of focal_mm, u0_mm and v0_mm the value, the
/// prediction and the sigma of their difference, and chi2.
std::string c_arm_csv(std::span<const calibration::AcquisitionCheck> acquisitions);

/// A row per acquisition with a distortion map: position, date, how far the map is off the prediction by all
/// others, and off one map for all.
Table c_arm_map_table(const calibration::CArmMaps& maps);

/// Lines of text: both variations with their intervals, the range predicted at the positions, drift,
/// isocentres.
std::string c_arm_text(const calibration::CArmModel& model);

/// Both variations with their intervals, the range predicted at the positions, and each acquisition beside
/// the prediction by all others.
Json to_json(const calibration::CArmModel& model);

/// Chi-square of all acquisitions with its limit, each acquisition, and what the check cannot see.
Json to_json(const calibration::CArmCheck& check);

/// A page with the C-arm's variation, its curves over the primary angle, and each acquisition beside the
/// prediction by all others. It names no image and no person.
std::string c_arm_report_html(const calibration::CArmModel& model,
                              std::span<const calibration::AcquisitionCheck> left_out);

/// The same as PDF, with lines for date and signature.
std::string c_arm_report_pdf(const calibration::CArmModel& model,
                             std::span<const calibration::AcquisitionCheck> left_out);

/// Writes report.html, report.pdf, c_arm.csv, c_arm.svg and, of distortion maps and runs, c_arm_maps.csv and
/// c_arm_runs.csv of a history into `folder`, without files of an earlier report.
Expected<void> write_c_arm_report(const calibration::CArmModel& model, const std::filesystem::path& folder);

}  // namespace helicarm::report
