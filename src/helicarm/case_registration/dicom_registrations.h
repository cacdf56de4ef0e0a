// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "helicarm/case_registration/register_case.h"

namespace helicarm::case_registration {

/// UID of the calibrator's frame: the same for the same cameras.
std::string calibrator_frame_uid(const std::vector<geometry::View>& views);
/// Of the views of a registration.
std::string calibrator_frame_uid(const CaseRegistration& result);

/// Writes MODEL_registration.dcm, a DICOM Spatial Registration from the CT's frame of reference to the
/// calibrator's, for each model that is not refused and whose volume is a DICOM series, and returns these
/// files; nothing where no model's volume is a DICOM series that states its frame of reference. The files
/// hold the patient, study and frame of reference of the series that was read. Fails as `slice_of_series` and
/// `write_spatial_registration`.
Expected<std::optional<std::vector<std::filesystem::path>>> write_dicom_registrations(
    const pipeline::Case& the_case, const CaseRegistration& result, const std::filesystem::path& folder);

}  // namespace helicarm::case_registration
