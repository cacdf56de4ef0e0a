// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/core/json.h"
#include "helicarm/simulation/simulate_case.h"
#include "helicarm/xray/write_dicom.h"

namespace helicarm::simulation {

/// case.json (docs/formats.md); not for kind grid, which has no calibrator.
Json case_json(const SimulatedCase& simulated);

/// The DICOM image of one view, with UIDs derived from its pixels.
xray::DerivedImage dicom_of(const SimulatedCase& simulated, std::size_t view);

/// Refuses (cannot_write) a folder with files other than an earlier simulation.
Expected<void> check_case_folder(const std::filesystem::path& folder);

/// Removes the files of an earlier simulation from its folder, by their names in its truth.json; others stay.
void forget_case(const std::filesystem::path& folder);

/// Writes an image NAME.dcm for each view, calibrator.json, plate.json, case.json and truth.json; for kind
/// grid PLATE.dcm, GRID.dcm (with several distances GRID-30.dcm and so on), plate.json and truth.json. Each
/// file is written atomically; leftovers of an earlier simulation are removed.
Expected<void> write_case(const std::filesystem::path& folder, const SimulatedCase& simulated);

}  // namespace helicarm::simulation
