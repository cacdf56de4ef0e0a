// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "helicarm/case_registration/register_case.h"
#include "signals.h"

namespace helicarm::python {

/// The options of run_case, register and register_sequence, checked as by the program; `function` begins the
/// messages. `history`: a C-arm's history file, which may be missing if it is extended by the measurement.
/// `cache`: a folder for the maps of plate images, true for the user's, false for none.
case_registration::RegisterOptions measuring_options(const char* function, const std::string& method,
                                                     std::optional<double> max_error_mm,
                                                     double motion_sigma_mm, double search_mm,
                                                     double search_deg, unsigned threads,
                                                     const std::optional<std::filesystem::path>& history,
                                                     const py::object& cache, bool extends_history = false);

/// Hears of every stage, step and share, and may end the work between them. Refers to `hooks`.
case_registration::Progress progress_of(const RunHooks& hooks);

}  // namespace helicarm::python
