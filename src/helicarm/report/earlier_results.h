// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

/// Whatever its exit code, a command leaves nothing of its kind from an earlier run in its folder: call these
/// before anything can fail. Files of others stay.
namespace helicarm::report {

/// File name of a model's DICOM registration; `index` among the models.
std::string dicom_registration_name(const std::string& model, std::size_t index);

/// File name of a DICOM measurement report.
inline constexpr const char* dicom_measurements_name = "measurements.dcm";

/// All files of `run` in this folder, also those of a run with models; overlays by the names of the views in
/// the result that it holds.
void forget_results(const std::filesystem::path& folder);

/// All files of `register`, also of a sequence.
void forget_registration(const std::filesystem::path& folder);

}  // namespace helicarm::report
