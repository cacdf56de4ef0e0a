// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/core/json.h"

namespace helicarm {

/// Table 2's figures of one column, mm.
struct ErrorFigures {
  double max = 0;
  double min = 0;
  double mean = 0;
  double sd = 0;   ///< the paper's "RMS" is this
  double rms = 0;  ///< about zero
  std::size_t n = 0;
};

/// Of at least one error; throws std::invalid_argument for none.
ErrorFigures figures_of(std::span<const double> errors_mm);
Json to_json(const ErrorFigures& figures);

}  // namespace helicarm
