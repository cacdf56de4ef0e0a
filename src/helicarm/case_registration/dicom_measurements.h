// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/case_registration/measure_case.h"
#include "helicarm/xray/measurement_report.h"

namespace helicarm::case_registration {

/// What was measured, as groups of a DICOM measurement report: located points and points of plans with their
/// 95 % error, tunnels, tool lines against the plan, and measures in bones, all in the calibrator's frame.
/// `images`: of each view its number among the report's images; nothing: it has none there.
std::vector<xray::ReportGroup> report_groups(const Measurement& measured,
                                             const std::vector<std::optional<std::size_t>>& images);

/// Writes a measurement report with the images that are DICOM files, whose patient and study it has. Returns
/// why it was left out: no image is a DICOM file that names its study and series, or nothing was measured.
/// Refuses as `write_measurement_report`, the refusal of a measurement that was refused, patient_mismatch for
/// images of two patients or of another than was measured, and bad_value for views or images that were not.
Expected<std::optional<std::string>> write_dicom_measurements(const pipeline::Case& the_case,
                                                              const Measurement& measured,
                                                              const std::filesystem::path& file);

/// What `write_dicom_results` wrote, and of what it left out why.
struct DicomResults {
  std::vector<std::filesystem::path> files;
  std::vector<std::string> left_out;
};

/// Writes measurements.dcm (`write_dicom_measurements`, unless the measurement was refused) into `folder`,
/// and `write_dicom_registrations` into `registrations`, as far as the case has what they need. Refuses as
/// these.
Expected<DicomResults> write_available_dicom(const pipeline::Case& the_case, const Measurement& measured,
                                             const std::filesystem::path& folder,
                                             const std::filesystem::path& registrations);

/// The same for who asked for it: bad_value where all is left out.
Expected<DicomResults> write_dicom_results(const pipeline::Case& the_case, const Measurement& measured,
                                           const std::filesystem::path& folder,
                                           const std::filesystem::path& registrations);

}  // namespace helicarm::case_registration
