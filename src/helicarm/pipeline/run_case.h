// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// The paper's method from images to tunnels. A refusal is in `Result::failure`, with all results before it;
/// unreadable input (exit code 2) fails.
Expected<Result> run_case(const Case& given, const RunOptions& options);

}  // namespace helicarm::pipeline
