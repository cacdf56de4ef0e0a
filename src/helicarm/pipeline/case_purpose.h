// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "helicarm/pipeline/case.h"

namespace helicarm::pipeline {

/// What a case.json is read for where no command says it: registration where a view names a camera of another
/// program, else a run.
Purpose purpose_of(const Json& case_json);

/// As `read_case`, for that purpose.
Expected<Case> read_any_case(const std::filesystem::path& path);

}  // namespace helicarm::pipeline
