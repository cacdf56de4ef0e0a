// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "helicarm/core/json.h"

namespace helicarm::operation {

/// Statistics of one column of Table 2, mm.
struct ErrorFigures {
  double max = 0;
  double min = 0;
  double mean = 0;
  double sd = 0;   ///< the paper prints this as "RMS"
  double rms = 0;  ///< about zero
  std::size_t n = 0;
};

/// Requires at least one error; throws std::invalid_argument for none.
ErrorFigures figures_of(std::span<const double> errors_mm);
Json to_json(const ErrorFigures& figures);

}  // namespace helicarm::operation
