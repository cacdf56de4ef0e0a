// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "helicarm/calibration/c_arm_maps.h"
#include "helicarm/calibration/c_arm_model.h"
#include "helicarm/calibration/c_arm_variations.h"
#include "helicarm/core/json.h"

namespace helicarm::report {

inline constexpr std::array<const char*, 3> intrinsic_names{"focal", "u0", "v0"};

/// A recorded distortion map beside the prediction by all others.
struct LeftOutMap {
  calibration::HistoryEntry entry;
  calibration::MapCheck check;
};

/// What a C-arm's record shows.
struct CArmFindings {
  calibration::CArmModel model = {};
  calibration::CArmVariations variations = {};
  std::vector<calibration::AcquisitionCheck> left_out = {};  ///< each beside the prediction by all others
  std::optional<calibration::CArmDrift> drift = {};
  std::size_t maps = 0;                        ///< recorded distortion maps of one detector
  std::vector<LeftOutMap> left_out_maps = {};  ///< of two maps or more
};

CArmFindings c_arm_findings(const calibration::CArmModel& model);

/// How many of them lie inside the 95 % region that all others predict.
std::ptrdiff_t inside_95(std::span<const calibration::AcquisitionCheck> left_out);

/// Lines of text: both variations with their intervals, the range predicted at the positions, drift,
/// isocentres, distortion.
std::string c_arm_text(const CArmFindings& findings);

/// Both variations with their intervals, the range predicted at the positions, each acquisition and map
/// beside the prediction by all others, drift and runs.
Json to_json(const CArmFindings& findings);

/// Chi-square of all acquisitions with its limit, each acquisition, and what the check cannot see.
Json to_json(const calibration::CArmCheck& check);

/// A row per acquisition: view, date, primary_deg, secondary_deg, then of focal_mm, u0_mm and v0_mm the
/// value, the prediction and the sigma of their difference, and chi2.
std::string c_arm_csv(std::span<const calibration::AcquisitionCheck> acquisitions);

/// A row per map: view, date, primary_deg, secondary_deg, error_px, one_map_px, expected_px.
std::string c_arm_map_csv(std::span<const LeftOutMap> maps);

/// A row per run: date, images, arc_deg, radius_mm, sx_mm, sy_mm, sz_mm, source_to_axis_mm.
std::string c_arm_run_csv(std::span<const calibration::RunIsocentre> runs);

}  // namespace helicarm::report
