// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "command_line.h"
#include "helicarm/case_registration/measure_case.h"

namespace helicarm::cli {

struct RunArguments {
  std::filesystem::path folder;  ///< holds case.json
  std::filesystem::path out = "helicarm-result";
  case_registration::RegisterOptions options = {};  ///< threads and C-arm history are filled in
  bool no_report = false;  ///< only result.json, and registration.json with its report
  std::optional<std::filesystem::path> history = {};  ///< the C-arm's history
  bool extends_history = false;  ///< by this case's acquisitions; a missing file is then a new history
  std::optional<std::filesystem::path> cache = {};  ///< of plate images' maps; nothing: the user's
  bool no_cache = false;
  bool dicom = false;  ///< also a DICOM measurement report and registrations
};

/// `run_fields`, --machine, --cache and --no-cache.
void add_run_options(CLI::App* command, RunArguments& arguments, const char* machine_help);

/// --dicom.
void add_dicom_option(CLI::App* command, bool& dicom);

/// Writes the DICOM files of a measurement of the case into `out`, those of its models into `registrations`,
/// and says what is left out.
void write_dicom_files(const pipeline::Case& the_case, const case_registration::Measurement& measured,
                       const std::filesystem::path& out, const std::filesystem::path& registrations,
                       Console& console);

/// Measures a case and writes result.json, report.html and NAME_overlay.png; of a case with models also
/// `case_registration::write_models`. A refusal also writes them and then fails with its reason; unusable
/// input leaves no result.json.
CommandResult run_one_case(const RunArguments& arguments, Console& console);

/// Only measures the case, with its findings on `console.progress`; a refusal is in the result.
Expected<case_registration::Measurement> measured_case(const RunArguments& arguments, Console& console);

/// As `run_one_case`, and returns the measurement; prints nothing to `console.out`.
Expected<case_registration::Measurement> run_and_write(const RunArguments& arguments, Console& console);

/// The arguments' options with threads and C-arm history.
Expected<case_registration::RegisterOptions> options_of(const RunArguments& arguments, Console& console);

/// Decision, pose, agreement and plan points of each model, for a terminal.
std::string summary_of(const case_registration::CaseRegistration& registration);

}  // namespace helicarm::cli
