// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/core/json.h"
#include "helicarm/simulation/simulate_case.h"
#include "helicarm/xray/write_dicom.h"

namespace helicarm::simulation {

/// case.json as docs/formats.md describes it; not of kind grid, which has no calibrator.
Json case_json(const SimulatedCase& simulated);

/// The image of one view as it is written, with the UIDs of its seed.
DerivedImage dicom_of(const SimulatedCase& simulated, std::size_t view);

/// Refuses (cannot_write) a folder that holds anything but an earlier simulation.
Expected<void> check_case_folder(const std::filesystem::path& folder);

/// Writes an image NAME.dcm for each view, calibrator.json, plate.json, case.json and truth.json; of kind
/// grid PLATE.dcm, GRID.dcm (with several distances GRID-30.dcm and so on), plate.json and truth.json. Each
/// file whole or not at all; what an earlier simulation left goes.
Expected<void> write_case(const std::filesystem::path& folder, const SimulatedCase& simulated);

}  // namespace helicarm::simulation
