// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "helicarm/pipeline/case.h"
#include "helicarm/pipeline/result.h"

namespace helicarm {

/// The paper's method from images to tunnels. Data that allow no trustworthy answer give a result that says
/// so
/// (`Result::failure`) and keeps what was known until then; only input that cannot be used (exit code 2)
/// fails.
Expected<Result> run_case(const Case& given, const RunOptions& options);

}  // namespace helicarm
