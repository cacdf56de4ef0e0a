// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "helicarm/pipeline/result.h"

namespace helicarm::pipeline {

/// What may have caused a refusal, and what to do first.
struct Advice {
  std::vector<std::string> causes;  ///< likely ones first
  std::string next;
};

/// For a refused result, by the reason, its figures, and what was found before it; empty without a refusal
/// and for codes of exit 2.
Advice advice_for(const Result& result);

}  // namespace helicarm::pipeline
